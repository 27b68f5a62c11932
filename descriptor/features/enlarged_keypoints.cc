// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/enlarged_keypoints.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace pliant {
namespace {

constexpr double kEnlargement = 2;
constexpr int kEnlargedSide = 1024;         // pixels, at most: a larger image is not a small one
constexpr double kLeastEnlargement = 1.25;  // below, nothing new comes to light

constexpr float kTwinPlace = 0.25F;  // of the smaller size

bool IsTwin(const Keypoint& a, const Keypoint& b) {
  constexpr float kOctaves = 1.2F;  // ratio of sizes
  const float reach = kTwinPlace * std::min(a.size, b.size);
  return std::abs(a.x - b.x) < reach && std::abs(a.y - b.y) < reach && a.size < kOctaves * b.size &&
         b.size < kOctaves * a.size;
}

constexpr int kMargin = 64;             // pixels of what is decoded
constexpr int kWholeSide = 4096;        // what is decoded is kept in memory for a moment
constexpr double kLeastPartGain = 1.1;  // below, what is decoded already does

// What lies in the image.
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

constexpr double kSecondPass = 3;      // times the original's longer side
constexpr double kBeyondSide = 1.5;    // times the side that is allowed otherwise
constexpr int kUsualSide = 1024;       // allowed where there is no limit
constexpr int kStripPixels = 600'000;  // without the overlap
constexpr int kOverlap = 96;           // rows on either side: what DEAL sees around fine keypoints

// Rows of the image.
struct Strip {
  int top = 0, bottom = 0;    // of its keypoints
  int first = 0, height = 0;  // of what they are described from
};

std::vector<Strip> StripsOf(const Image& image) {
  const std::int64_t pixels = std::int64_t{image.width} * image.height;
  const int count = static_cast<int>((pixels + kStripPixels - 1) / kStripPixels);
  const int rows = (image.height + count - 1) / count;
  const int height = std::min(image.height, rows + 2 * kOverlap);
  std::vector<Strip> strips;
  for (int top = 0; top < image.height; top += rows) {
    strips.push_back({top, std::min(image.height, top + rows),
                      std::clamp(top - kOverlap, 0, image.height - height), height});
  }
  return strips;
}

// How much larger DetectEnlarged makes an image with this longer side; 1 = not at all.
double EnlargementOf(double longer_side_px, int max_side_px) {
  const int side = max_side_px > 0 ? std::min(max_side_px, kEnlargedSide) : kEnlargedSide;
  const double factor = std::min(kEnlargement, side / longer_side_px);
  return factor < kLeastEnlargement ? 1 : factor;
}

// The keypoints of `found` in `image` that `known` does not have. `known` and `placed` are in
// pixels of another image, which `image` shows scaled by `scale`, from row `top` (in its own
// pixels) on.
EnlargedKeypoints WithoutKnown(Image image, double scale, int top, std::span<const Keypoint> found,
                               std::span<const Keypoint> known) {
  EnlargedKeypoints result;
  result.image = std::move(image);
  std::vector<Keypoint> placed(found.begin(), found.end());
  for (Keypoint& k : placed) k.y += static_cast<float>(top);
  ScaleToOriginal(placed, scale);
  std::vector<Keypoint> by_x(known.begin(), known.end());
  std::sort(by_x.begin(), by_x.end(), [](const auto& a, const auto& b) { return a.x < b.x; });
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Keypoint& place = placed[i];
    const float reach = kTwinPlace * place.size;
    auto other = std::lower_bound(by_x.begin(), by_x.end(), place.x - reach,
                                  [](const Keypoint& k, float x) { return k.x < x; });
    while (other != by_x.end() && other->x <= place.x + reach && !IsTwin(place, *other)) ++other;
    if (other != by_x.end() && other->x <= place.x + reach) continue;
    result.inside.push_back(found[i]);
    result.placed.push_back(place);
  }
  return result;
}

// The image `factor` times as large, and its keypoints; options.inside is in pixels of `grey`.
std::pair<Image, std::vector<Keypoint>> DetectScaled(const Image& grey, double factor,
                                                     KeypointOptions options, int threads) {
  const auto scaled = [&](int side) { return static_cast<int>(std::lround(side * factor)); };
  Image image = ResizeImage(grey, scaled(grey.width), scaled(grey.height));
  if (options.inside) options.inside = Scaled(*options.inside, factor);
  auto found = DetectLowContrastKeypoints(image, options, threads);
  return {std::move(image), std::move(found)};
}

}  // namespace

void ScaleToOriginal(std::vector<Keypoint>& keypoints, double scale) {
  if (scale == 1.0) return;
  const auto inverse = static_cast<float>(1.0 / scale);
  for (Keypoint& k : keypoints) {
    k.x = (k.x + 0.5F) * inverse - 0.5F;
    k.y = (k.y + 0.5F) * inverse - 0.5F;
    k.size *= inverse;
  }
}

EnlargedKeypoints DetectEnlarged(const Image& grey, std::span<const Keypoint> known,
                                 int max_side_px, const KeypointOptions& options, int threads) {
  const double factor = EnlargementOf(std::max(grey.width, grey.height), max_side_px);
  if (factor == 1) return {};
  auto [image, found] = DetectScaled(grey, factor, options, threads);
  return WithoutKnown(std::move(image), factor, /*top=*/0, found, known);
}

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
  if (scale > kLeastPartGain * view.decoded.scale) {
    DecodeOptions finer = options;
    finer.max_side_px = static_cast<int>(std::ceil(scale * whole));
    finer.thumbnail_side_px = 0;
    DecodedImage again = decode(encoded, finer);
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

std::optional<int> SecondPassSide(double longer_side_px, int max_side_px) {
  const double own =
      max_side_px > 0 ? std::min<double>(longer_side_px, max_side_px) : longer_side_px;
  const double seen = own * EnlargementOf(own, max_side_px);
  const double finer = std::min(kSecondPass * longer_side_px,
                                kBeyondSide * (max_side_px > 0 ? max_side_px : kUsualSide));
  if (finer < kLeastEnlargement * seen) return {};
  return static_cast<int>(finer);
}

std::vector<EnlargedKeypoints> DetectAtHighResolution(const Image& grey,
                                                      std::span<const Keypoint> known,
                                                      double factor, const KeypointOptions& options,
                                                      int threads) {
  const auto [image, all] = DetectScaled(grey, factor, options, threads);
  std::vector<EnlargedKeypoints> result;
  for (const Strip& strip : StripsOf(image)) {
    std::vector<Keypoint> found;
    for (Keypoint k : all) {
      const auto row = static_cast<int>(std::lround(k.y));  // centres are at integers
      if (row < strip.top || row >= strip.bottom) continue;
      k.y -= static_cast<float>(strip.first);
      found.push_back(k);
    }
    result.push_back(WithoutKnown(CutOut(image, {0, strip.first, image.width, strip.height}),
                                  factor, strip.first, found, known));
  }
  return result;
}

}  // namespace pliant
