// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant match A B; pliant match DIR --colmap FILE
#include <algorithm>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "descriptor/base/parallel.h"
#include "descriptor/drawing/match_drawing.h"
#include "descriptor/evaluation/dataset.h"
#include "descriptor/evaluation/metrics.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/image_input.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"
#include "index/cli/write_file.h"
#include "index/files/text.h"
#include "index/store/colmap_database.h"
#include "index/verify/verification.h"

namespace pliant::cli {
namespace {

using evaluation::TruthScene;
struct Options {
  EngineOptions engine;  // only what concerns extraction
  std::filesystem::path first, second;
  std::filesystem::path homography;
  std::filesystem::path draw;
  std::filesystem::path colmap;  // a new COLMAP database of all images of a folder
  std::filesystem::path pairs;   // two names per line; empty = all pairs
  bool one_camera = false;
  MatchOptions match{.max_ratio = 1, .mutual_only = true, .threads = 0};
  double tolerance_px = 3;
  bool verify = false;
  bool json = false;
};

// The matches, and what is known about them.
struct Result {
  Features first, second;
  std::vector<Match> matches;     // Match::reference: of the first image
  std::vector<Verdict> verdicts;  // one per match
  std::optional<int> correct;     // of those whose truth is known
  int known = 0;
  int true_pairs = 0;                              // that could have been matched
  std::optional<VerificationResult> verification;  // warp: first -> second
};

std::unique_ptr<TruthScene> FindTruth(const Options& options, const Result& result) {
  if (options.homography.empty()) return evaluation::FindTruth(options.first, options.second);
  std::vector<Image> frames;  // only the sizes count
  for (const Features* f : {&result.first, &result.second})
    frames.push_back({f->width, f->height, 1, {}});
  return std::make_unique<evaluation::HomographyScene>(
      std::move(frames), std::vector{evaluation::Homography{1, 0, 0, 0, 1, 0, 0, 0, 1},
                                     evaluation::ReadHomography(options.homography)});
}

void Judge(TruthScene& truth, const Options& options, Result& result) {
  std::vector<std::optional<Vec2>> positions;
  for (const Keypoint& k : result.first.keypoints) positions.push_back(truth.Map(0, {k.x, k.y}, 1));
  result.true_pairs = static_cast<int>(
      evaluation::FindTruePairs(positions, result.second.keypoints, options.tolerance_px).size());
  result.correct = 0;
  for (std::size_t m = 0; m < result.matches.size(); ++m) {
    const Keypoint& k = result.first.keypoints[result.matches[m].reference];
    if (!truth.OnObject(0, {k.x, k.y})) continue;
    const bool correct = evaluation::IsCorrect(result.matches[m], positions,
                                               result.second.keypoints, options.tolerance_px);
    result.verdicts[m] = correct ? Verdict::kTrue : Verdict::kFalse;
    ++result.known;
    *result.correct += correct ? 1 : 0;
  }
}

// Both are read once: standard input is there once.
struct Images {
  ImageInput first, second;
};

Images ReadImages(const Options& options) {
  if (options.first == "-" && options.second == "-") {
    throw Error(ErrorCode::kInvalidArgument, "bad_arguments",
                "only one of the two images can be standard input");
  }
  const std::int64_t max_bytes = options.engine.extraction.decode.max_bytes;
  return {ReadImage(options.first, max_bytes), ReadImage(options.second, max_bytes)};
}

Result MatchImages(const Options& options, const Images& images) {
  const FeatureExtractor extractor(NamedDescriptor(options.engine), options.engine.extraction);
  Result result;
  const auto extract = [&](const ImageInput& image) {
    return Naming(image, [&] { return extractor.Extract(image.bytes, options.match.threads); });
  };
  result.first = extract(images.first);
  result.second = extract(images.second);
  CheckDescriptors(result.first.descriptors, "the first image's descriptors");
  CheckDescriptors(result.second.descriptors, "the second image's descriptors");
  result.matches = MatchDescriptors(PackedDescriptors(result.second.descriptors),
                                    result.first.descriptors, options.match);
  result.verdicts.resize(result.matches.size(), Verdict::kUnknown);
  if (const std::unique_ptr<TruthScene> truth = FindTruth(options, result))
    Judge(*truth, options, result);
  if (options.verify) {
    VerificationOptions verification;
    verification.threads = options.match.threads;
    result.verification = Verifier(result.second, verification).Verify(result.first);
  }
  return result;
}

// [[x, y], ...]
template <typename Points>
Json PositionsJson(const Points& points) {
  Json positions = Json::array();
  for (const auto& p : points) positions.push_back({p.x, p.y});
  return positions;
}

Json ToJson(const Result& result) {
  Json matches = Json::array();
  for (const Match& m : result.matches) matches.push_back({m.reference, m.query, m.distance});
  Json json = {{"keypoints", {result.first.keypoints.size(), result.second.keypoints.size()}},
               {"matches", std::move(matches)},
               {"correct", OrNull(result.correct)},
               {"known", result.known},
               {"true_pairs", result.correct ? Json(result.true_pairs) : Json()},
               {"model_id", result.first.model_id},
               {"positions",
                {PositionsJson(result.first.keypoints), PositionsJson(result.second.keypoints)}}};
  if (const auto& verification = result.verification) {
    Json inliers = Json::array();
    for (const MatchedPair& pair : verification->inliers) {
      inliers.push_back({pair.reference, pair.query});
    }
    json["verification"] = {{"verified", verification->verified()},
                            {"tentative", verification->matches},
                            {"inliers", std::move(inliers)},
                            {"outline", PositionsJson(verification->outline)}};
  }
  return json;
}

std::string Summary(const Result& result) {
  std::string text =
      fmt::format("{} and {} keypoints, {} mutual matches", result.first.keypoints.size(),
                  result.second.keypoints.size(), result.matches.size());
  if (result.correct) {
    text += fmt::format("; of {} on the object {} are correct ({} possible)", result.known,
                        *result.correct, result.true_pairs);
  }
  if (result.verification) {
    text += fmt::format("; {} {}", result.verification->inliers.size(),
                        result.verification->verified() ? "fit one warp" : "inliers: not verified");
  }
  return text;
}

Image DecodeForDrawing(const ImageInput& image, DecodeOptions decode, double& scale) {
  decode.colour = true;
  DecodedImage decoded = DecodeImage(image.bytes, decode);
  scale = decoded.scale;
  return std::move(decoded.image);
}

Vec2 Scaled(double x, double y, double scale) {
  return {(x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5};
}

// All mutual matches, or with --verify those that fit the warp.
void Draw(const Options& options, const Images& images, const Result& result) {
  double first_scale = 1, second_scale = 1;
  const DecodeOptions& decode = options.engine.extraction.decode;
  const Image first = DecodeForDrawing(images.first, decode, first_scale);
  const Image second = DecodeForDrawing(images.second, decode, second_scale);
  std::vector<DrawnMatch> drawn;
  std::vector<Vec2> outline;
  for (std::size_t m = 0; m < result.matches.size(); ++m) {
    const Match& match = result.matches[m];
    const auto is_match = [&match](const MatchedPair& pair) {
      return pair.reference == match.reference && pair.query == match.query;
    };
    if (result.verification && std::ranges::none_of(result.verification->inliers, is_match)) {
      continue;
    }
    const Keypoint& a = result.first.keypoints[match.reference];
    const Keypoint& b = result.second.keypoints[match.query];
    drawn.push_back(
        {Scaled(a.x, a.y, first_scale), Scaled(b.x, b.y, second_scale), result.verdicts[m]});
  }
  if (result.verification) {
    for (const Vec2& p : result.verification->outline)
      outline.push_back(Scaled(p.x, p.y, second_scale));
  }
  WriteImage(options.draw, DrawMatches(first, second, drawn, outline, Summary(result)));
}

using Pair = std::pair<std::size_t, std::size_t>;

// A point of the upright image in the pixels as they are stored (EXIF 2.3, tag 0x0112), which is
// what COLMAP reads: 5 to 8 are 1 to 4 after a transposition. `width`, `height`: of the upright
// image.
Vec2 AsStored(Vec2 p, int orientation, int width, int height) {
  const int flip = (orientation - 1) % 4;
  if (flip == 1 || flip == 2) p.x = width - 1.0 - p.x;  // left to right
  if (flip == 2 || flip == 3) p.y = height - 1.0 - p.y;
  return orientation >= 5 ? Vec2{p.y, p.x} : p;
}

// `pliant match --colmap`: all images of a folder matched with each other. Images that cannot be
// read are skipped and reported.
class ColmapExport {
 public:
  explicit ColmapExport(const Options& options) : options_(options) {}

  ExitStatus Run() {
    const std::unique_ptr<ColmapDatabase> database =
        CreateColmapDatabase(options_.colmap, options_.one_camera);
    std::vector<std::filesystem::path> inputs = {options_.first};
    if (!options_.second.empty()) inputs.push_back(options_.second);
    folder_ = FindFolderImages(inputs);
    RequireTwo(" found");
    if (!options_.pairs.empty()) ReadPairs();
    DescribeFolder(folder_, options_.engine, options_.match.threads, interrupt_);
    if (!Stopped()) {
      RequireTwo(" that can be described");
      Store(*database);
      MatchAll(*database);
    }
    if (Stopped()) {
      Message("stopped on request; nothing was written");
      return ExitStatus::kFailed;
    }
    database->Publish();
    Report();
    return folder_.skipped.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
  }

 private:
  bool Stopped() const { return interrupt_.requested(); }

  void RequireTwo(const std::string& which) const {
    const std::size_t count = folder_.images.size();
    if (count >= 2) return;
    ReportSkipped(folder_.skipped);
    throw Error(ErrorCode::kInvalidArgument, "too_few_images",
                fmt::format("{} {}{}; matching needs two or more", count,
                            count == 1 ? "image" : "images", which));
  }

  void Store(ColmapDatabase& database) {
    for (const FolderImage& image : folder_.images) {
      CheckDescriptors(image.features.descriptors, "the image's descriptors");
      packed_.emplace_back(image.features.descriptors);
      const Features& features = image.features;
      std::vector<Vec2> points;
      for (const Keypoint& k : features.keypoints) {
        points.push_back(
            AsStored({k.x, k.y}, image.exif_orientation, features.width, features.height));
      }
      const bool turned = image.exif_orientation >= 5;
      numbers_.push_back(database.AddImage({image.name, turned ? features.height : features.width,
                                            turned ? features.width : features.height, points}));
    }
  }

  // Pairs of images, each once, the one that comes first in the folder first.
  std::vector<Pair> Pairs() const {
    std::vector<Pair> pairs;
    std::map<std::string, std::size_t> at;
    for (std::size_t b = 0; b < folder_.images.size(); ++b) {
      at[folder_.images[b].name] = b;
      for (std::size_t a = 0; a < b && options_.pairs.empty(); ++a) pairs.emplace_back(a, b);
    }
    for (const auto& [first, second] : listed_) {  // without those of skipped images
      if (at.contains(first) && at.contains(second)) pairs.emplace_back(at[first], at[second]);
    }
    return pairs;
  }

  // COLMAP's match list: two names a line.
  void ReadPairs() {
    std::ifstream file(options_.pairs);
    const std::string shown = PathText(options_.pairs);
    if (!file || std::filesystem::is_directory(options_.pairs)) {
      throw Error(ErrorCode::kNotFound, "cannot_read", shown + " cannot be read");
    }
    const auto invalid = [&shown](const std::string& why) {
      return Error(ErrorCode::kInvalidArgument, "pairs_invalid", shown + why);
    };
    std::set<std::string> names;
    for (const FolderImage& image : folder_.images) names.insert(image.name);
    std::string line;
    for (int number = 1; std::getline(file, line); ++number) {
      std::istringstream words(line);
      std::string first, second, rest;
      if (!(words >> first) || first[0] == '#') continue;
      if (!(words >> second) || (words >> rest) || first == second) {
        throw invalid(fmt::format(":{}: this line must name two different images", number));
      }
      for (const std::string& name : {first, second}) {
        if (names.contains(name)) continue;
        throw invalid(fmt::format(":{}: there is no image {} below {}", number, ToDisplayText(name),
                                  PathText(folder_.root)));
      }
      listed_.insert(std::minmax(first, second));
    }
    if (listed_.empty()) throw invalid(" names no images");
  }

  std::vector<PointNumbers> MatchPair(std::size_t a, std::size_t b) const {
    std::vector<PointNumbers> found;
    const Features& first = folder_.images[a].features;
    if (options_.verify) {
      const Verifier verifier(folder_.images[b].features);
      for (const MatchedPair& pair : verifier.Verify(first).inliers) {
        found.emplace_back(pair.reference, pair.query);
      }
      return found;
    }
    MatchOptions match = options_.match;
    match.threads = 1;
    for (const Match& m : MatchDescriptors(packed_[b], first.descriptors, match)) {
      found.emplace_back(m.reference, m.query);
    }
    return found;
  }

  void MatchAll(ColmapDatabase& database) {
    const std::vector<Pair> pairs = Pairs();
    std::mutex mutex;  // guards the database and the counts
    Progress progress("pairs");
    ParallelFor(pairs.size(), options_.match.threads, [&](std::size_t i) {
      if (Stopped()) return;
      const auto& [a, b] = pairs[i];
      const std::vector<PointNumbers> found = MatchPair(a, b);
      const std::lock_guard lock(mutex);
      database.AddMatches(numbers_[a], numbers_[b], found);
      matches_ += found.size();
      progress.Count(++pairs_, pairs.size());
    });
  }

  void Report() const {
    const std::string root = PathText(folder_.root);
    const std::string file = PathText(options_.colmap);
    if (!options_.json) ReportSkipped(folder_.skipped);
    cli::Report(options_.json,
                {{"file", file},
                 {"image_path", root},
                 {"images", folder_.images.size()},
                 {"pairs", pairs_},
                 {"matches", matches_},
                 {"model_id", folder_.images[0].features.model_id},
                 {"skipped", SkippedJson(folder_.skipped)}},
                "wrote {}: {} images below {}, {} matches of {} pairs", file, folder_.images.size(),
                root, matches_, pairs_);
  }

  const Options& options_;
  const Interrupt interrupt_;
  FolderFeatures folder_;
  std::vector<PackedDescriptors> packed_;  // one per image
  std::vector<int> numbers_;               // in the database
  std::set<std::pair<std::string, std::string>> listed_;
  std::uint64_t pairs_ = 0;
  std::uint64_t matches_ = 0;
};

ExitStatus Run(Options& options) {
  if (!options.colmap.empty()) return ColmapExport(options).Run();
  if (options.second.empty()) throw CLI::RequiredError("B");
  CheckNotInput(options.draw, {options.first, options.second, options.homography});
  CheckImageOutput(options.draw, "--draw", options.json);
  const Images images = ReadImages(options);
  const Result result = MatchImages(options, images);
  if (!options.draw.empty()) Draw(options, images, result);
  Report(options.json, ToJson(result), "{}", Summary(result));
  return ExitStatus::kDone;
}

}  // namespace

void AddMatchCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = program.add_subcommand("match", "Match the keypoints of two images");
  app->add_option("A", options->first, "an image; - = standard input; with --colmap also a folder")
      ->required();
  app->add_option("B", options->second, "another image of the same object");
  AddExtractionFlags(*app, options->engine);
  AddRatioFlag(*app, "--ratio", options->match.max_ratio);
  CLI::Option* homography =
      app->add_option(
             "--homography", options->homography,
             "file with nine numbers that map pixels of A to pixels of B, to show which "
             "matches are correct (simulated scenes and the non-rigid benchmark need none)")
          ->type_name("FILE");
  app->add_option("--tolerance", options->tolerance_px,
                  "largest distance of a correct match from the true position, in pixels")
      ->check(AboveZero());
  app->add_flag("--verify", options->verify, "keep only matches that fit one smooth warp");
  CLI::Option* draw =
      app->add_option(
             "--draw", options->draw,
             "draw both images with the matches: blue correct, orange wrong, purple unknown; "
             "- = standard output")
          ->type_name("FILE");
  CLI::Option* colmap =
      app->add_option(
             "--colmap", options->colmap,
             "write the keypoints of the folder's images, and the matches of all pairs, to "
             "this new COLMAP database")
          ->type_name("FILE")
          ->excludes(draw)
          ->excludes(homography);
  app->add_option("--pairs", options->pairs,
                  "file with two image names per line: match only these pairs")
      ->type_name("FILE")
      ->needs(colmap);
  app->add_flag("--one-camera", options->one_camera,
                "one camera with one focal length took all images")
      ->needs(colmap);
  AddJobsFlag(*app, options->match.threads);
  AddJsonFlag(*app, options->json);
  app->footer(
      "Example:  pliant match A.jpg B.jpg --verify --draw matches.png\n"
      "          pliant match views/ --colmap views.db\n"
      "          colmap exhaustive_matcher --database_path views.db --SiftMatching.use_gpu 0\n"
      "          colmap mapper --database_path views.db --image_path views --output_path model");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
