// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/search_drawing.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "descriptor/base/utf8.h"
#include "descriptor/drawing/drawing.h"
#include "server/http/compression.h"

namespace pliant::server {

namespace {

constexpr int kLongerSide = 1600;
constexpr int kJpegQuality = 90;
constexpr std::size_t kMostLetters = 40;  // of a name

std::string Shortened(const std::string& text) {
  const std::u32string letters = DecodeUtf8(text);
  if (letters.size() <= kMostLetters) return text;
  return EncodeUtf8(letters.substr(0, kMostLetters)) + "…";
}

std::string NameOf(const Hit& hit) {
  const std::string name = Shortened(!hit.object.empty()   ? hit.object
                                     : !hit.source.empty() ? hit.source
                                                           : hit.image_id);
  if (!hit.probability) return name;
  return fmt::format("{}  {} %", name, static_cast<int>(std::floor(*hit.probability * 100)));
}

class Sheet {
 public:
  Sheet(Image image, double scale)
      : image_(std::move(image)),
        scale_(scale),
        letters_(std::clamp(std::max(image_.width, image_.height) / 60, 9, 22)),
        line_(std::max(2, letters_ / 5)) {}

  void Outline(const std::vector<Point>& polygon, Colour colour) {
    DrawPolyline(image_, OnSheet(polygon), true, colour, line_);
  }
  // Above the outline's highest point, inside the image.
  void Name(const std::vector<Point>& polygon, const std::string& name, Colour colour) {
    const std::vector<Vec2> points = OnSheet(polygon);
    const Vec2 top =
        *std::min_element(points.begin(), points.end(), [](Vec2 a, Vec2 b) { return a.y < b.y; });
    Label(top.x, top.y - letters_, name, colour);
  }
  void Label(double x, double y, const std::string& text, Colour colour) {
    const int pad = letters_ / 2;
    const int width = TextWidth(text, letters_) + 2 * pad;
    const int height = letters_ + 2 * pad;
    const int left =
        std::clamp(static_cast<int>(std::clamp(x, 0.0, 1e6)), 0, std::max(0, image_.width - width));
    const int above = std::clamp(static_cast<int>(std::clamp(y, 0.0, 1e6)) - height, 0,
                                 std::max(0, image_.height - height));
    FillBox(image_, left, above, width, height, colour);
    DrawText(image_, left + pad, above + pad + letters_, text, colours::kBlack, letters_);
  }
  const Image& image() const { return image_; }

 private:
  // Pixel centres are at integers, before and after scaling.
  std::vector<Vec2> OnSheet(const std::vector<Point>& polygon) const {
    std::vector<Vec2> points;
    for (const Point& p : polygon) {
      points.push_back({(p.x + 0.5) * scale_ - 0.5, (p.y + 0.5) * scale_ - 0.5});
    }
    return points;
  }

  Image image_;
  const double scale_;  // sheet pixels / original pixels
  const int letters_;   // height in pixels
  const int line_;
};

bool IsDrawn(const Hit& hit, double found_from) {
  return !hit.polygon.empty() && hit.probability.value_or(1) >= found_from;
}

}  // namespace

bool PrefersPng(const std::string& accept) {
  std::map<std::string, int> weights = WeightsOf(accept);
  const int png = weights["image/png"];
  return png > 0 && png >= weights["image/jpeg"];
}

std::string DrawSearch(Bytes query, DecodeOptions options, const ImageDecoder& decode,
                       const SearchResult& result, bool png) {
  options.max_side_px = kLongerSide;
  options.max_bytes = std::max(options.max_bytes, static_cast<std::int64_t>(query.size()));
  options.colour = true;
  const DecodedImage decoded = decode(query, options);
  Sheet sheet(ToColour(decoded.image), decoded.scale);
  std::vector<const Hit*> drawn;
  for (const Hit& hit : result.hits) {
    if (IsDrawn(hit, result.found_from)) drawn.push_back(&hit);
  }
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    for (const Instance& instance : drawn[i]->instances) {
      if (!instance.polygon.empty()) sheet.Outline(instance.polygon, DistinctColour(i));
    }
  }
  for (std::size_t i = 0; i < drawn.size(); ++i) {  // above all lines
    sheet.Name(drawn[i]->polygon, NameOf(*drawn[i]), DistinctColour(i));
  }
  if (drawn.empty()) sheet.Label(0, sheet.image().height, "not found", colours::kGrey);
  const std::vector<std::uint8_t> bytes =
      png ? EncodePng(sheet.image()) : EncodeJpeg(sheet.image(), kJpegQuality);
  return {bytes.begin(), bytes.end()};
}

}  // namespace pliant::server
