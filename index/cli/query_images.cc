// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/query_images.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/drawing/drawing.h"
#include "descriptor/image/image.h"
#include "index/cli/output.h"
#include "index/cli/write_file.h"
#include "index/engine/engine.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

// The result of a query as images: the matches, and the flattened object.
struct ShownHit {
  Hit hit;                            // with its explanation
  std::optional<DecodedImage> image;  // in colour; nullopt if its bytes were not kept
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
  std::string text = std::to_string(hit.rank) + ".  " +
                     (hit.object.empty() ? hit.image_id : hit.object) + "   score " +
                     FormatFixed(hit.score, 3);
  if (!hit.explanation) return text;
  const Explanation& e = *hit.explanation;
  if (e.verified) {
    return text + "   " + std::to_string(e.inliers.size()) + " of " + std::to_string(e.matches) +
           " matches agree";
  }
  return text + "   not confirmed";
}

// Colours go by the place in the hit's image, so that neighbours have like colours and a wrong
// line stands out.
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
             "(the image itself was not kept in the database)", colours::kGrey, kLetters);
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

// Where the mesh puts a point of the reference image; nothing where it is not to be trusted.
std::optional<Vec2> Map(const Mesh& mesh, Vec2 p) {
  const double column = p.x / std::max(1.0, mesh.reference_width - 1.0) * (mesh.columns - 1);
  const double row = p.y / std::max(1.0, mesh.reference_height - 1.0) * (mesh.rows - 1);
  const int c = std::clamp(static_cast<int>(column), 0, mesh.columns - 2);
  const int r = std::clamp(static_cast<int>(row), 0, mesh.rows - 2);
  const double fx = column - c;
  const double fy = row - r;
  const std::array<double, 4> weights = {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy,
                                         fx * fy};
  Vec2 sum;
  for (int corner = 0; corner < 4; ++corner) {
    const auto at = static_cast<std::size_t>((r + corner / 2) * mesh.columns + c + corner % 2);
    if (!mesh.trusted[at]) return std::nullopt;
    sum.x += weights[static_cast<std::size_t>(corner)] * mesh.points[at].x;
    sum.y += weights[static_cast<std::size_t>(corner)] * mesh.points[at].y;
  }
  return sum;
}

// Bilinear; nothing outside.
bool Sample(const Image& image, Vec2 p, std::uint8_t* rgb) {
  if (!(p.x >= 0 && p.y >= 0 && p.x <= image.width - 1 && p.y <= image.height - 1)) return false;
  const int x = std::min(static_cast<int>(p.x), std::max(0, image.width - 2));
  const int y = std::min(static_cast<int>(p.y), std::max(0, image.height - 2));
  const int x1 = std::min(x + 1, image.width - 1);
  const int y1 = std::min(y + 1, image.height - 1);
  const double fx = p.x - x;
  const double fy = p.y - y;
  const auto pixel = [&](int px, int py, int channel) -> double {
    return image.pixels[(static_cast<std::size_t>(py) * image.width + px) * 3 + channel];
  };
  for (int channel = 0; channel < 3; ++channel) {
    const double above = (1 - fx) * pixel(x, y, channel) + fx * pixel(x1, y, channel);
    const double below = (1 - fx) * pixel(x, y1, channel) + fx * pixel(x1, y1, channel);
    rgb[channel] = static_cast<std::uint8_t>(std::lround((1 - fy) * above + fy * below));
  }
  return true;
}

Image Flatten(const DecodedImage& query, const Mesh& mesh, int width, int height) {
  const Image frame = ToColour(query.image);
  const double to_reference = static_cast<double>(mesh.reference_width) / width;
  Image flat = BlankImage(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      std::uint8_t* rgb = &flat.pixels[(static_cast<std::size_t>(y) * width + x) * 3];
      const auto mapped =
          Map(mesh, {(x + 0.5) * to_reference - 0.5, (y + 0.5) * to_reference - 0.5});
      if (mapped &&
          Sample(frame,
                 {(mapped->x + 0.5) * query.scale - 0.5, (mapped->y + 0.5) * query.scale - 0.5},
                 rgb)) {
        continue;
      }
      const std::uint8_t grey = (x / kCheck + y / kCheck) % 2 == 0 ? 92 : 108;
      std::fill(rgb, rgb + 3, grey);
    }
  }
  return flat;
}

// One row per hit: a caption, the query with the object's outline, the hit's image, and a line
// for each pair of matching points that agrees with the warp. 3 channels.
Image DrawHits(const DecodedImage& query, const std::vector<ShownHit>& hits) {
  const int row = kCaption + kBoxHeight + kGap / 2;
  const auto rows = static_cast<int>(std::max<std::size_t>(1, hits.size()));
  Image sheet = BlankImage(3 * kGap + 2 * kBoxWidth, rows * row, kPaper);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    DrawRow(sheet, query, hits[i], static_cast<int>(i) * row);
  }
  if (hits.empty()) {
    DrawText(sheet, kGap, kCaption - 10, "nothing found", colours::kWhite, kLetters);
    const Placed only = Fit(query, kGap, kCaption);
    PasteImage(sheet, only.image, only.x, only.y);
  }
  return sheet;
}

// The object as the query shows it, flattened through the warp to the shape of the hit's image,
// beside that image. A check pattern fills the parts where the warp is not trusted or leaves the
// query. Throws kInvalidArgument for a hit that was not verified.
Image DrawUnwarped(const DecodedImage& query, const ShownHit& shown) {
  const Hit& hit = shown.hit;
  if (!hit.explanation || !hit.explanation->mesh) {
    throw Error(ErrorCode::kInvalidArgument, "not_verified",
                "hit " + std::to_string(hit.rank) + " was not verified: there is no warp");
  }
  const Mesh& mesh = *hit.explanation->mesh;
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

namespace fs = std::filesystem;

constexpr int kMaxSide = 1280;  // of the images drawn from

DecodedImage Decode(Bytes bytes, DecodeOptions options) {
  options.max_side_px = kMaxSide;
  options.colour = true;
  return DecodeImage(bytes, options);
}

ShownHit Show(Engine& engine, const Hit& hit, const QueryImageOptions& options) {
  ShownHit shown{hit, std::nullopt};
  try {
    shown.image = Decode(engine.GetContent(options.collection, hit.image_id), options.decode);
  } catch (const Error& error) {
    // Not kept, or removed by another process just now: the row says so.
    if (error.code() != ErrorCode::kNotFound) throw;
  }
  return shown;
}

// "02-red-shirt.png" for the second hit, of the object "red shirt".
std::string FileName(const Hit& hit) {
  std::string name = (hit.rank < 10 ? "0" : "") + std::to_string(hit.rank) + '-';
  for (const char c : hit.object.empty() ? hit.image_id : hit.object) {
    const auto byte = static_cast<unsigned char>(c);
    name += std::isalnum(byte) != 0 || byte >= 0x80 || c == '_' || c == '.' ? c : '-';
  }
  return name.substr(0, 120) + ".png";
}

bool WriteUnwarped(Engine& engine, const DecodedImage& query, const SearchResult& result,
                   const QueryImageOptions& options) {
  const bool one_file = options.unwarp.extension() == ".png" || options.unwarp == kStandardOutput;
  bool any = false;
  for (const Hit& hit : result.hits) {
    if (!hit.explanation || !hit.explanation->mesh) continue;
    if (!any && !one_file) {
      std::error_code error;
      fs::create_directories(options.unwarp, error);
      if (error) {
        throw Error(ErrorCode::kNoSpace, "write_failed",
                    "cannot make the folder " + ToDisplayText(options.unwarp.string()) + ": " +
                        error.message());
      }
    }
    any = true;
    WriteImage(one_file ? options.unwarp : options.unwarp / FileName(hit),
               DrawUnwarped(query, Show(engine, hit, options)));
    if (one_file) break;
  }
  if (!any) {
    Message("skipped " + ToDisplayText(options.unwarp.string()) +
            ": no hit was verified, so there is nothing to unwarp");
  }
  return any;
}

}  // namespace

bool WriteQueryImages(Engine& engine, Bytes query, const SearchResult& result,
                      const QueryImageOptions& options) {
  if (options.draw.empty() && options.unwarp.empty()) return true;
  const DecodedImage decoded = Decode(query, options.decode);
  if (!options.draw.empty()) {
    std::vector<ShownHit> shown;
    for (const Hit& hit : result.hits) shown.push_back(Show(engine, hit, options));
    WriteImage(options.draw, DrawHits(decoded, shown));
  }
  return options.unwarp.empty() || WriteUnwarped(engine, decoded, result, options);
}

}  // namespace pliant::cli
