// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant query IMAGE --db FILE
#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/base/stopwatch.h"
#include "descriptor/drawing/drawing.h"
#include "descriptor/image/image.h"
#include "descriptor/warp/unwarp.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/image_input.h"
#include "index/cli/output.h"
#include "index/cli/write_file.h"
#include "index/files/text.h"
#include "index/json/result_json.h"
#include "index/records/filter.h"

namespace pliant::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
  EngineOptions engine;
  SearchOptions search;
  std::filesystem::path image;
  std::vector<double> region;
  std::string filter;
  fs::path draw;    // PNG file; empty = none
  fs::path unwarp;  // PNG file for the best verified hit, else a folder for all
  bool json = false;
};

void PrintText(const SearchResult& result, const Json& document, double took_ms) {
  if (!result.hits.empty()) {
    if (result.perhaps) {
      Print("perhaps: no hit has a probability of {:.1f} or more", result.found_from);
    } else if (result.found == std::size_t{0}) {
      Print("not found: no hit has a probability of {:.1f} or more", kPerhapsProbability);
    }
    if (result.mirrored) Print("the image shows it mirrored");
    Print(TableOf(document["hits"], {{"/rank", "rank"},
                                     {"/score", "score", 4},
                                     {"/probability", "probability"},
                                     {"/inliers", "inliers"},
                                     {"/object", "object"},
                                     {"/image_id", "image"},
                                     {"/source", "file"}}));
  } else if (result.total == 0) {
    Print("no hits");
  } else {
    Print("no hits on this page: --offset is beyond the last of {} hits", result.total);
  }
  Message("{} of {} hits, {} keypoints, vocabulary {} of {} words, {:.0f} ms", result.hits.size(),
          result.total, result.keypoints, result.vocabulary, result.words, took_ms);
}

void PrintExplanations(const SearchResult& result) {
  for (const Hit& hit : result.hits) {
    if (!hit.explanation) continue;
    const Explanation& e = *hit.explanation;
    Print("{}. {}: ranking score {:.4f}{}", hit.rank, hit.image_id, e.ranking_score,
          e.verified ? fmt::format("; {} of {} matches fit one warp", e.inliers.size(), e.matches)
                     : ". " + e.failure);
  }
}

// The result of a query as images: the matches, and the flattened object.
struct ShownHit {
  Hit hit;                            // with its explanation
  std::optional<DecodedImage> image;  // in colour; nullopt if its file is not kept, or lost
};

constexpr int kBoxWidth = 480;  // each image of a row is fitted into it
constexpr int kBoxHeight = 360;
constexpr int kGap = 24;      // between the two images
constexpr int kCaption = 30;  // pixels above a row
constexpr int kLetters = 13;
constexpr int kUnwarpedSide = 640;  // longer side of a flattened object
constexpr int kCheck = 12;          // of the pattern where nothing is known
constexpr Colour kPaper{24, 26, 30};
constexpr Colour kOutline{255, 190, 40};

// An image fitted into a box, and where points of the original upright image lie on the sheet.
struct Placed {
  Image image;
  int x = 0, y = 0;  // of its top left pixel on the sheet
  double scale = 1;  // sheet pixels / original pixels

  Vec2 OnSheet(Vec2 p) const {
    return {x + (p.x + 0.5) * scale - 0.5, y + (p.y + 0.5) * scale - 0.5};
  }
};

Placed Fit(const DecodedImage& decoded, int x, int y) {
  const Image& image = decoded.image;
  const double factor = std::min(static_cast<double>(kBoxWidth) / image.width,
                                 static_cast<double>(kBoxHeight) / image.height);
  const int width = std::max(1, static_cast<int>(std::lround(image.width * factor)));
  const int height = std::max(1, static_cast<int>(std::lround(image.height * factor)));
  return {ToColour(ResizeImage(image, width, height)), x + (kBoxWidth - width) / 2,
          y + (kBoxHeight - height) / 2, static_cast<double>(width) / decoded.original_width};
}

std::string Caption(const Hit& hit) {
  std::string text = fmt::format("{}.  {}   score {:.3f}", hit.rank,
                                 hit.object.empty() ? hit.image_id : hit.object, hit.score);
  if (!hit.explanation) return text;
  const Explanation& e = *hit.explanation;
  return text + (e.verified ? fmt::format("   {} of {} matches fit", e.inliers.size(), e.matches)
                            : "   not verified");
}

// Colours depend on the place in the hit's image, so that neighbours have similar colours and a
// wrong line stands out.
Colour ColourOfPlace(Vec2 p, const Explanation& e) {
  const double u = std::clamp(p.x / std::max(1, e.reference_width), 0.0, 1.0);
  const double v = std::clamp(p.y / std::max(1, e.reference_height), 0.0, 1.0);
  const auto byte = [](double value) { return static_cast<std::uint8_t>(std::lround(value)); };
  return {byte(60 + 195 * u), byte(235 - 60 * u * v), byte(60 + 195 * v)};
}

void DrawRow(Image& sheet, const DecodedImage& query, const ShownHit& shown, int top) {
  DrawText(sheet, kGap, top + kCaption - 10, Caption(shown.hit), colours::kWhite, kLetters);
  Placed left = Fit(query, kGap, top + kCaption);
  std::vector<Vec2> outline;  // drawn before pasting, so that it ends at the image's border
  for (const Point& p : shown.hit.polygon) {
    const Vec2 at = left.OnSheet({p.x, p.y});
    outline.push_back({at.x - left.x, at.y - left.y});
  }
  if (!outline.empty()) DrawPolyline(left.image, outline, true, kOutline, 2);
  PasteImage(sheet, left.image, left.x, left.y);
  const int right_x = 2 * kGap + kBoxWidth;
  if (!shown.image) {
    DrawText(sheet, right_x + 20, top + kCaption + kBoxHeight / 2,
             "(this image's file is not stored, or damaged)", colours::kGrey, kLetters);
    return;
  }
  const Placed right = Fit(*shown.image, right_x, top + kCaption);
  PasteImage(sheet, right.image, right.x, right.y);
  if (!shown.hit.explanation) return;
  const Explanation& e = *shown.hit.explanation;
  for (const PointPair& pair : e.inliers) {
    const Colour colour = ColourOfPlace(pair.reference, e);
    const Vec2 from = left.OnSheet(pair.query);
    const Vec2 to = right.OnSheet(pair.reference);
    DrawLine(sheet, from, to, colour);
    DrawDot(sheet, from, 2, colour);
    DrawDot(sheet, to, 2, colour);
  }
}

// The object, flattened to width x height through the mesh; a check pattern where the mesh is not
// trusted or leaves the query.
Image Flatten(const DecodedImage& query, const Mesh& mesh, int width, int height) {
  const double scale = static_cast<double>(width) / mesh.reference_width;
  std::vector<Vec2> from, to;
  for (int row = 0; row < mesh.rows; ++row) {
    for (int column = 0; column < mesh.columns; ++column) {
      const Vec2 r = mesh.reference_point(column, row);
      const Vec2 q = mesh.points[from.size()];
      from.push_back({(r.x + 0.5) * scale - 0.5, (r.y + 0.5) * scale - 0.5});
      to.push_back({(q.x + 0.5) * query.scale - 0.5, (q.y + 0.5) * query.scale - 0.5});
    }
  }
  const TpsOptions exact{.regularization = 0, .max_control_points = static_cast<int>(from.size())};
  UnwarpedImage flat =
      Unwarp(ToColour(query.image), ThinPlateSpline::Fit(from, to, exact), width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * width + x;
      const int corner =
          y * (mesh.rows - 1) / height * mesh.columns + x * (mesh.columns - 1) / width;
      const auto trusted = mesh.trusted.begin() + corner;
      const auto below = trusted + mesh.columns;
      if (flat.known[pixel] && trusted[0] && trusted[1] && below[0] && below[1]) continue;
      const std::uint8_t grey = (x / kCheck + y / kCheck) % 2 == 0 ? 92 : 108;
      std::fill_n(&flat.image.pixels[3 * pixel], 3, grey);
    }
  }
  return std::move(flat.image);
}

// One row per hit: a caption, the query with the object's outline, the hit's image, and a line
// for each match that fits the warp. 3 channels.
Image DrawHits(const DecodedImage& query, const std::vector<ShownHit>& hits) {
  const int row = kCaption + kBoxHeight + kGap / 2;
  const auto rows = static_cast<int>(std::max<std::size_t>(1, hits.size()));
  Image sheet = BlankImage(3 * kGap + 2 * kBoxWidth, rows * row, kPaper);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    DrawRow(sheet, query, hits[i], static_cast<int>(i) * row);
  }
  if (hits.empty()) {
    DrawText(sheet, kGap, kCaption - 10, "no hits", colours::kWhite, kLetters);
    const Placed only = Fit(query, kGap, kCaption);
    PasteImage(sheet, only.image, only.x, only.y);
  }
  return sheet;
}

// The object as the query shows it, flattened through the warp to the shape of the hit's image,
// beside that image. A check pattern fills the parts where the warp is not trusted or leaves the
// query. The hit must be verified.
Image DrawUnwarped(const DecodedImage& query, const ShownHit& shown) {
  const Hit& hit = shown.hit;
  const Mesh& mesh = hit.explanation->mesh.value();
  const double factor =
      static_cast<double>(kUnwarpedSide) / std::max(mesh.reference_width, mesh.reference_height);
  const int width = std::max(1, static_cast<int>(std::lround(mesh.reference_width * factor)));
  const int height = std::max(1, static_cast<int>(std::lround(mesh.reference_height * factor)));
  const int images = shown.image ? 2 : 1;
  Image sheet = BlankImage(kGap + images * (width + kGap), kCaption + height + kGap, kPaper);
  DrawText(sheet, kGap, kCaption - 10, Caption(hit), colours::kWhite, kLetters);
  PasteImage(sheet, Flatten(query, mesh, width, height), kGap, kCaption);
  if (shown.image) {
    PasteImage(sheet, ToColour(ResizeImage(shown.image->image, width, height)), 2 * kGap + width,
               kCaption);
  }
  return sheet;
}

constexpr int kMaxSide = 1280;  // of the images drawn from

DecodedImage Decode(Bytes bytes, DecodeOptions options) {
  options.max_side_px = kMaxSide;
  options.colour = true;
  return DecodeImage(bytes, options);
}

// `complete` becomes false if the file is lost or damaged (reported on standard error).
ShownHit Show(Engine& engine, const Hit& hit, const Options& options, bool& complete) {
  ShownHit shown{hit, std::nullopt};
  try {
    shown.image = Decode(engine.GetContent(options.search.collection, hit.image_id),
                         options.engine.extraction.decode);
  } catch (const Error& error) {
    // Not kept, or removed by another process just now: the row says so.
    if (error.code() == ErrorCode::kNotFound) return shown;
    complete = false;
    Message("skipped the image of hit {}, {}: {}", hit.rank,
            ToDisplayText(hit.object.empty() ? hit.image_id : hit.object),
            ToDisplayText(error.what()));
  }
  return shown;
}

// "02-red-shirt.png" for the second hit, of the object "red shirt".
std::string FileName(const Hit& hit) {
  std::string name = fmt::format("{:02}-", hit.rank);
  for (const char c : hit.object.empty() ? hit.image_id : hit.object) {
    const auto byte = static_cast<unsigned char>(c);
    name += std::isalnum(byte) != 0 || byte >= 0x80 || c == '_' || c == '.' ? c : '-';
  }
  return name.substr(0, 120) + ".png";
}

bool WriteUnwarped(Engine& engine, const DecodedImage& query, const SearchResult& result,
                   const Options& options) {
  const bool one_file = IsImageName(options.unwarp);
  bool any = false;
  bool complete = true;
  // A mesh of a few chance matches shows nothing.
  const std::size_t found = std::min(result.hits.size(), result.found.value_or(result.hits.size()));
  for (const Hit& hit : std::span(result.hits).first(found)) {
    if (!hit.explanation || !hit.explanation->mesh) continue;
    if (!any && !one_file) {
      std::error_code error;
      fs::create_directories(options.unwarp, error);
      if (error) {
        throw Error(
            ErrorCode::kNoSpace, "write_failed",
            "cannot create the folder " + PathText(options.unwarp) + ": " + error.message());
      }
    }
    any = true;
    WriteImage(one_file ? options.unwarp : options.unwarp / FileName(hit),
               DrawUnwarped(query, Show(engine, hit, options, complete)));
    if (one_file) break;
  }
  if (!any) {
    Message("skipped {}: nothing was found, so there is nothing to unwarp",
            PathText(options.unwarp));
  }
  return any && complete;
}

// Writes the images that --draw and --unwarp ask for, from a result with explanations. false:
// nothing was found, so there was nothing to unwarp, or a stored image is lost (reported on
// standard error).
bool WriteQueryImages(Engine& engine, Bytes query, const SearchResult& result,
                      const Options& options) {
  if (options.draw.empty() && options.unwarp.empty()) return true;
  const DecodedImage decoded = Decode(query, options.engine.extraction.decode);
  bool complete = true;
  if (!options.draw.empty()) {
    std::vector<ShownHit> shown;
    for (const Hit& hit : result.hits) shown.push_back(Show(engine, hit, options, complete));
    WriteImage(options.draw, DrawHits(decoded, shown));
  }
  return (options.unwarp.empty() || WriteUnwarped(engine, decoded, result, options)) && complete;
}

ExitStatus Run(Options& options) {
  if (!options.region.empty()) {
    options.search.region =
        Region{options.region[0], options.region[1], options.region[2], options.region[3]};
  }
  if (!options.filter.empty()) options.search.filter = ParseFilter(options.filter);
  CheckNotInput(options.draw, {options.image});
  CheckNotInput(options.unwarp, {options.image});
  CheckImageOutput(options.draw, "--draw", options.json);
  if (IsImageName(options.unwarp)) {
    CheckOutput(options.unwarp, "--unwarp", options.json);
  } else {
    CheckFolderName(options.unwarp, "a .png or .jpg file");
  }
  const ImageInput image = ReadImage(options.image, options.engine.extraction.decode.max_bytes);
  options.engine.read_only = true;
  options.engine.create = false;
  Engine engine(options.engine);
  const Stopwatch watch;
  const bool explain = options.search.explain;
  options.search.explain |= !options.draw.empty() || !options.unwarp.empty();
  SearchResult result = Naming(image, [&] { return engine.Search(image.bytes, options.search); });
  const double took_ms = watch.ms();
  const bool drawn = WriteQueryImages(engine, image.bytes, result, options);
  if (!explain) {  // it was for the images only
    for (Hit& hit : result.hits) hit.explanation.reset();
  }
  const Json document = SearchResultJson(result, took_ms);
  if (options.json) {
    PrintJson(document);
  } else {
    PrintText(result, document, took_ms);
    PrintExplanations(result);
  }
  return drawn ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
}

}  // namespace

void AddQueryCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  SearchOptions& search = options->search;
  CLI::App* app = program.add_subcommand("query", "Find the object that an image shows");
  app->add_option("IMAGE", options->image, "the query image; - = standard input")->required();
  AddDatabaseFlag(*app, options->engine);
  AddCollectionFlag(*app, search.collection);
  app->add_option("--top", search.limit, "hits returned; 0 = all")->check(AtLeast(0));
  app->add_option("--offset", search.offset, "hits to skip at the start")->check(AtLeast(0));
  AddChoice<GroupBy>(*app, "--group-by", search.group_by,
                     "one hit for each object, or for each image (default: object)",
                     {{"object", GroupBy::kObject}, {"image", GroupBy::kImage}});
  AddRankFlag(
      *app, search.rank,
      "compare images by votes of nearest neighbours, or by the paper's histogram of visual "
      "words (default: neighbours)");
  AddChoice<Verification>(*app, "--verify", search.verify,
                          "verify that the best hits fit one smooth warp (default: tps; none with "
                          "--rank histogram)",
                          {{"none", Verification::kNone}, {"tps", Verification::kTps}});
  app->add_option("--verify-depth", search.verify_depth,
                  "number of candidates to verify (default: adaptive, 30 to 100, more in large "
                  "collections)")
      ->check(AboveZero())
      ->option_text("N");
  app->add_option("--instances", search.max_instances,
                  "maximum number of instances of one object in the query image")
      ->check(Between(1, 100));
  app->add_flag(
      "--closer-look,!--no-closer-look", search.second_pass,
      "if nothing is found, run a second pass at high resolution, and return the answer with "
      "more evidence; if little is found, look for mirrored objects (default: yes)");
  app->add_option("--region", options->region,
                  "search only this rectangle of the query image, in its pixels")
      ->delimiter(',')
      ->expected(4)
      ->type_name("X,Y,W,H")
      ->option_text("X,Y,W,H");
  app->add_option("--object", search.object, "only images of this object")->type_name("NAME");
  AddFilterFlag(
      *app, options->filter,
      "only images whose metadata match: JSON such as '{\"shop\": \"east\", \"year\": {\"gte\": "
      "2020}}'; tests are in, ne, gt, gte, lt, lte, prefix, contains, exists; join filters with "
      "and, or, not");
  app->add_option("--min-score", search.min_score, "drop hits below this score, 0 to 1")
      ->check(Within(0, 1));
  AddModelFlag(*app, options->engine.descriptor_options.model_path);
  app->add_flag("--explain", search.explain,
                "explain every hit: its score, the matches and the warp of its surface");
  app->add_option(
         "--draw", options->draw,
         "draw the query and its hits with outlines and matches to this .png or .jpg file; "
         "- = standard output")
      ->type_name("FILE");
  app->add_option("--unwarp", options->unwarp,
                  "draw the flattened object beside the hit: the best verified hit to a .png or "
                  ".jpg file (- = standard output), or all verified hits into a folder")
      ->type_name("FILE|DIR");
  AddJsonFlag(*app, options->json);
  app->footer(
      "Example:  pliant query PHOTO.jpg --db my.db --top 3 --draw found.png\n"
      "          curl -s https://example.org/a.jpg | pliant query - --db my.db --json");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
