// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant match A B; pliant match DIR --colmap FILE
#include <algorithm>
#include <memory>
#include <optional>

#include "descriptor/drawing/match_drawing.h"
#include "descriptor/evaluation/dataset.h"
#include "descriptor/evaluation/metrics.h"
#include "index/cli/colmap_export.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/image_input.h"
#include "index/cli/output.h"
#include "index/cli/write_file.h"
#include "index/files/image_files.h"
#include "index/verify/verification.h"

namespace pliant::cli {
namespace {

using evaluation::TruthScene;
struct Options {
  EngineOptions engine;  // only what concerns extraction
  std::filesystem::path first, second;
  std::filesystem::path homography;
  std::filesystem::path draw;
  ColmapExportOptions colmap;
  MatchOptions match{.max_ratio = 1, .mutual_only = true, .threads = 0};
  double tolerance_px = 3;
  bool verify = false;
  bool json = false;
};

// What was found, and what is known about it.
struct Result {
  Features first, second;
  std::vector<Match> matches;     // Match::reference: of the first image
  std::vector<Verdict> verdicts;  // one a match
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
                "only one of both images can be standard input");
  }
  const std::int64_t max_bytes = options.engine.extraction.decode.max_bytes;
  return {ReadImage(options.first, max_bytes), ReadImage(options.second, max_bytes)};
}

Result MatchImages(const Options& options, const Images& images) {
  const std::string name =
      options.engine.descriptor.empty() ? EngineOptions{}.descriptor : options.engine.descriptor;
  const FeatureExtractor extractor(MakeDescriptor(name, options.engine.descriptor_options),
                                   options.engine.extraction);
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

Json PlacesJson(const std::vector<Keypoint>& keypoints) {
  Json places = Json::array();
  for (const Keypoint& k : keypoints) places.push_back({k.x, k.y});
  return places;
}

Json ToJson(const Result& result) {
  Json matches = Json::array();
  for (const Match& m : result.matches) matches.push_back({m.reference, m.query, m.distance});
  Json json = {
      {"keypoints", {result.first.keypoints.size(), result.second.keypoints.size()}},
      {"matches", std::move(matches)},
      {"correct", result.correct ? Json(*result.correct) : Json()},
      {"known", result.known},
      {"true_pairs", result.correct ? Json(result.true_pairs) : Json()},
      {"model_id", result.first.model_id},
      {"positions", {PlacesJson(result.first.keypoints), PlacesJson(result.second.keypoints)}}};
  if (result.verification) {
    Json inliers = Json::array();
    for (const MatchedPair& pair : result.verification->inliers)
      inliers.push_back({pair.reference, pair.query});
    Json outline = Json::array();
    for (const Vec2& p : result.verification->outline) outline.push_back({p.x, p.y});
    json["verification"] = {{"verified", result.verification->verified()},
                            {"tentative", result.verification->matches},
                            {"inliers", std::move(inliers)},
                            {"outline", std::move(outline)}};
  }
  return json;
}

std::string Summary(const Result& result) {
  std::string text = std::to_string(result.first.keypoints.size()) + " and " +
                     std::to_string(result.second.keypoints.size()) + " keypoints, " +
                     std::to_string(result.matches.size()) + " mutual matches";
  if (result.correct) {
    text += "; of " + std::to_string(result.known) + " on the object " +
            std::to_string(*result.correct) + " are right (" + std::to_string(result.true_pairs) +
            " possible)";
  }
  if (result.verification) {
    text += "; " + std::to_string(result.verification->inliers.size()) +
            (result.verification->verified() ? " agree with one warp" : " agree: not verified");
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

// All mutual matches, or those that agree with the warp where that was asked for.
void Draw(const Options& options, const Images& images, const Result& result) {
  double first_scale = 1, second_scale = 1;
  const DecodeOptions& decode = options.engine.extraction.decode;
  const Image first = DecodeForDrawing(images.first, decode, first_scale);
  const Image second = DecodeForDrawing(images.second, decode, second_scale);
  std::vector<DrawnMatch> drawn;
  std::vector<Vec2> outline;
  for (std::size_t m = 0; m < result.matches.size(); ++m) {
    const Match& match = result.matches[m];
    if (result.verification) {
      const auto& inliers = result.verification->inliers;
      if (std::none_of(inliers.begin(), inliers.end(), [&match](const MatchedPair& pair) {
            return pair.reference == match.reference && pair.query == match.query;
          })) {
        continue;
      }
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

ExitStatus Export(Options& options) {
  ColmapExportOptions& colmap = options.colmap;
  colmap.inputs = {options.first};
  if (!options.second.empty()) colmap.inputs.push_back(options.second);
  colmap.match = options.match;
  colmap.verify = options.verify;
  colmap.json = options.json;
  return ExportToColmap(options.engine, colmap);
}

ExitStatus Run(Options& options) {
  if (!options.colmap.database.empty()) return Export(options);
  if (options.second.empty()) throw CLI::RequiredError("B");
  if (!options.draw.empty()) CheckImageName(options.draw);
  CheckNotInput(options.draw, {options.first, options.second, options.homography});
  if (options.draw == kStandardOutput) ClaimStandardOutput("--draw", options.json);
  const Images images = ReadImages(options);
  const Result result = MatchImages(options, images);
  if (!options.draw.empty()) Draw(options, images, result);
  if (options.json) {
    PrintJson(ToJson(result));
  } else {
    Print(Summary(result));
  }
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
  app->add_option("--ratio", options->match.max_ratio,
                  "ratio test: drop matches whose distance is more than this times that of the "
                  "second nearest")
      ->capture_default_str();
  CLI::Option* homography =
      app->add_option(
             "--homography", options->homography,
             "file with nine numbers that map pixels of A to pixels of B: shows which matches "
             "are correct "
             "(images of a simulated scene or of the non-rigid benchmark need none)")
          ->type_name("FILE");
  app->add_option("--tolerance", options->tolerance_px,
                  "distance from the true position, in pixels, up to which a match is correct")
      ->capture_default_str()
      ->check(AboveZero());
  app->add_flag("--verify", options->verify, "keep only matches that agree with one smooth warp");
  CLI::Option* draw =
      app->add_option("--draw", options->draw,
                      "draw both images with the matches: green correct, red wrong, blue unknown; "
                      "- = standard output")
          ->type_name("PNG");
  CLI::Option* colmap =
      app->add_option("--colmap", options->colmap.database,
                      "write the keypoints and matches of the folder's images, every two of "
                      "them, to this new database of COLMAP")
          ->type_name("FILE")
          ->excludes(draw)
          ->excludes(homography);
  app->add_option("--pairs", options->colmap.pairs,
                  "file with two names a line: match only these images with each other")
      ->type_name("FILE")
      ->needs(colmap);
  app->add_flag("--one-camera", options->colmap.one_camera,
                "all images were taken by one camera, with one focal length")
      ->needs(colmap);
  app->add_option("--jobs,-j", options->match.threads, "threads; 0 = one per core")
      ->capture_default_str()
      ->check(Between(0, 1024));
  app->add_flag("--json", options->json, "print one JSON document");
  app->footer(
      "Example:  pliant match A.jpg B.jpg --verify --draw matches.png\n"
      "          pliant match views/ --colmap views.db\n"
      "          colmap exhaustive_matcher --database_path views.db --SiftMatching.use_gpu 0\n"
      "          colmap mapper --database_path views.db --image_path views --output_path model");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
