// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/part_view.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pliant {
namespace {

constexpr int kMargin = 64;           // pixels of what is decoded
constexpr int kWholeSide = 4096;      // what is decoded is kept in memory for a moment
constexpr double kLeastCloser = 1.1;  // below, what is decoded already does

// What lies in the picture.
Region Clipped(const Region& part, int width, int height) {
  const double left = std::max(part.x, -0.5);
  const double top = std::max(part.y, -0.5);
  return {left, top, std::min(part.x + part.width, width - 0.5) - left,
          std::min(part.y + part.height, height - 0.5) - top};
}

// From the first pixel that begins before `from` to the last that ends behind `to`, with a margin.
std::pair<int, int> RangeAround(double from, double to, int size) {
  const int first = static_cast<int>(std::floor(from)) - kMargin;
  const int end = static_cast<int>(std::ceil(to)) + kMargin;
  const int begin = std::clamp(first, 0, size - 1);
  return {begin, std::clamp(end, begin + 1, size) - begin};
}

}  // namespace

double LongerSide(const Region& part, int width, int height) {
  const Region seen = Clipped(part, width, height);
  return seen.width > 0 && seen.height > 0 ? std::max(seen.width, seen.height) : 0;
}

std::optional<PartView> DecodePart(Bytes encoded, const Region& part, int side_px,
                                   const ImageDecoder& decode, const DecodeOptions& options) {
  PartView view;
  view.decoded = decode(encoded, options);
  const int width = view.decoded.original_width;
  const int height = view.decoded.original_height;
  const Region seen = Clipped(part, width, height);
  const double longer_side = LongerSide(part, width, height);
  if (longer_side == 0) return {};
  const int whole = std::max(width, height);
  double scale = 1;
  if (side_px > 0) scale = std::min(scale, side_px / longer_side);
  const int most = std::max(kWholeSide, options.max_side_px);
  if (options.max_side_px > 0) scale = std::min(scale, static_cast<double>(most) / whole);
  if (scale > kLeastCloser * view.decoded.scale) {
    DecodeOptions closer = options;
    closer.max_side_px = static_cast<int>(std::ceil(scale * whole));
    closer.thumbnail_side_px = 0;
    DecodedImage again = decode(encoded, closer);
    again.thumbnail = std::move(view.decoded.thumbnail);
    view.decoded = std::move(again);
  }
  const Region scaled = Scaled(seen, view.decoded.scale);
  const Image& image = view.decoded.image;
  const auto [left, box_width] = RangeAround(scaled.x, scaled.x + scaled.width, image.width);
  const auto [top, box_height] = RangeAround(scaled.y, scaled.y + scaled.height, image.height);
  view.decoded.image = CutOut(image, {left, top, box_width, box_height});
  view.inside = SeenFrom(scaled, left, top);
  view.left = left / view.decoded.scale;
  view.top = top / view.decoded.scale;
  return view;
}

}  // namespace pliant
