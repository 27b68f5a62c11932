// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/appearance.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "index/verify/colour_difference.h"
#include "index/verify/constants.h"
#include "index/verify/warp_geometry.h"

namespace pliant {
namespace {

constexpr int kRadius = kVerify.window_radius;
constexpr int kDisplacement = kRadius / 2;  // largest, in x and in y: warps are that inexact
constexpr int kLeastSide = 6 * kRadius;     // of the smaller of the compared images

// A grey image whose windows are summed in constant time.
class WindowSums {
 public:
  template <typename Value>
  WindowSums(int width, int height, const Value& value)
      : width_(width),
        height_(height),
        sums_(static_cast<std::size_t>(width + 1) * static_cast<std::size_t>(height + 1), 0) {
    for (int y = 0; y < height; ++y) {
      std::int64_t row = 0;
      for (int x = 0; x < width; ++x) {
        row += value(x, y);
        sums_[At(x + 1, y + 1)] = sums_[At(x + 1, y)] + row;
      }
    }
  }

  // The mean over the window around the pixel, as far as it lies in the image.
  double Mean(int x, int y) const {
    const int left = std::max(0, x - kRadius);
    const int top = std::max(0, y - kRadius);
    const int right = std::min(width_, x + kRadius + 1);
    const int bottom = std::min(height_, y + kRadius + 1);
    const std::int64_t sum = sums_[At(right, bottom)] - sums_[At(left, bottom)] -
                             sums_[At(right, top)] + sums_[At(left, top)];
    return static_cast<double>(sum) / ((right - left) * (bottom - top));
  }

 private:
  std::size_t At(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_ + 1) +
           static_cast<std::size_t>(x);
  }

  int width_, height_;
  std::vector<std::int64_t> sums_;
};

// The query's preview, seen as the reference is.
struct Rectified {
  Image image;
  std::vector<bool> visible;  // by pixel: in the query, and the warp is reliable
};

std::size_t PixelAt(const Image& image, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
         static_cast<std::size_t>(x);
}

// Bilinear; the point must lie inside.
std::uint8_t Sample(const Image& image, Vec2 p) {
  const int x = std::min(static_cast<int>(p.x), image.width - 2);
  const int y = std::min(static_cast<int>(p.y), image.height - 2);
  const double u = p.x - x;
  const double v = p.y - y;
  const std::uint8_t* const at = &image.pixels[PixelAt(image, x, y)];
  const double above = at[0] + u * (at[1] - at[0]);
  const double below = at[image.width] + u * (at[image.width + 1] - at[image.width]);
  return static_cast<std::uint8_t>(std::lround(above + v * (below - above)));
}

// The centre of a pixel of a scaled image, in another scale of it.
double Rescaled(double pixel, int from, int to) { return (pixel + 0.5) * to / from - 0.5; }

// Where the mesh maps a point of the reference; nullopt where it is not trusted.
std::optional<Vec2> Mapped(const Mesh& mesh, Vec2 p) {
  const double column = p.x * (mesh.columns - 1) / (mesh.reference_width - 1.0);
  const double row = p.y * (mesh.rows - 1) / (mesh.reference_height - 1.0);
  const int c = std::clamp(static_cast<int>(column), 0, mesh.columns - 2);
  const int r = std::clamp(static_cast<int>(row), 0, mesh.rows - 2);
  const double u = std::clamp(column - c, 0.0, 1.0);
  const double v = std::clamp(row - r, 0.0, 1.0);
  const auto at = static_cast<std::size_t>(r * mesh.columns + c);
  const auto below = at + static_cast<std::size_t>(mesh.columns);
  for (const std::size_t corner : {at, at + 1, below, below + 1}) {
    if (!mesh.trusted[corner]) return std::nullopt;
  }
  const auto between = [](Vec2 a, Vec2 b, double t) {
    return Vec2{std::lerp(a.x, b.x, t), std::lerp(a.y, b.y, t)};
  };
  return between(between(mesh.points[at], mesh.points[at + 1], u),
                 between(mesh.points[below], mesh.points[below + 1], u), v);
}

// To an image of the size of `reference`, which shows all of the mesh's reference.
Rectified Rectify(const Image& query, int query_width, int query_height, const Mesh& mesh,
                  const Image& reference) {
  Rectified rectified{reference, std::vector<bool>(reference.pixels.size(), false)};
  for (int y = 0; y < reference.height; ++y) {
    for (int x = 0; x < reference.width; ++x) {
      const auto mapped = Mapped(mesh, {Rescaled(x, reference.width, mesh.reference_width),
                                        Rescaled(y, reference.height, mesh.reference_height)});
      if (!mapped) continue;
      const Vec2 p{Rescaled(mapped->x, query_width, query.width),
                   Rescaled(mapped->y, query_height, query.height)};
      if (!(p.x >= 0 && p.y >= 0 && p.x <= query.width - 1 && p.y <= query.height - 1)) continue;
      rectified.image.pixels[PixelAt(reference, x, y)] = Sample(query, p);
      rectified.visible[PixelAt(reference, x, y)] = true;
    }
  }
  return rectified;
}

// Of the window around each pixel.
struct Moments {
  std::vector<double> means;
  std::vector<double> deviations;  // standard
};

Moments MomentsOf(const Image& image) {
  const auto value = [&](int x, int y) -> std::int64_t {
    return image.pixels[PixelAt(image, x, y)];
  };
  const WindowSums sums(image.width, image.height, value);
  const WindowSums squares(image.width, image.height,
                           [&](int x, int y) { return value(x, y) * value(x, y); });
  Moments moments;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double mean = sums.Mean(x, y);
      moments.means.push_back(mean);
      moments.deviations.push_back(
          std::sqrt(std::max(kVerify.grey_noise, squares.Mean(x, y) - mean * mean)));
    }
  }
  return moments;
}

// Of the windows around each pixel of two images of one size: the best of all displacements.
std::vector<double> Correlations(const Image& a, const Moments& of_a, const Image& b) {
  const Moments of_b = MomentsOf(b);
  std::vector<double> best(a.pixels.size(), -1);
  for (int dy = -kDisplacement; dy <= kDisplacement; ++dy) {
    for (int dx = -kDisplacement; dx <= kDisplacement; ++dx) {
      const auto moved = [&](int x, int y) {
        return PixelAt(b, std::clamp(x + dx, 0, b.width - 1), std::clamp(y + dy, 0, b.height - 1));
      };
      const WindowSums products(a.width, a.height, [&](int x, int y) -> std::int64_t {
        return a.pixels[PixelAt(a, x, y)] * b.pixels[moved(x, y)];
      });
      for (int y = 0; y < a.height; ++y) {
        for (int x = 0; x < a.width; ++x) {
          const std::size_t at = PixelAt(a, x, y);
          const std::size_t there = moved(x, y);
          const double covariance = products.Mean(x, y) - of_a.means[at] * of_b.means[there];
          best[at] =
              std::max(best[at], covariance / (of_a.deviations[at] * of_b.deviations[there]));
        }
      }
    }
  }
  return best;
}

Image Shrunk(const Image& image, double factor) {
  if (factor >= 1) return image;
  return ResizeImage(image, std::max(1, static_cast<int>(std::lround(image.width * factor))),
                     std::max(1, static_cast<int>(std::lround(image.height * factor))));
}

Image Preview(const Features& features) {
  return DecodeImage(features.preview, {.max_side_px = 0, .min_side_px = 1}).image;
}

// Query pixels per reference pixel: the median at the corners of `seen`.
double ScaleOf(const ThinPlateSpline& warp, const std::vector<Vec2>& seen) {
  std::vector<double> scales;
  for (const Vec2 p : seen) scales.push_back(std::max(0.0, LocalScale(warp, p)));
  return Median(std::move(scales));
}

// What the query and the reference show, at the coarser resolution of the two.
struct Views {
  Image photo;
  Image expected;
};

// nullopt if the object is too small in one of them.
std::optional<Views> ViewsOf(const Features& query, const Features& reference, double scale) {
  const Views whole{Preview(query), Preview(reference)};
  // Pixels of the photo per pixel of what is expected.
  scale *=
      static_cast<double>(whole.photo.width) / query.width * reference.width / whole.expected.width;
  if (!(scale > 0)) return std::nullopt;
  Views views{Shrunk(whole.photo, 1 / scale), Shrunk(whole.expected, scale)};
  for (const Image& view : {views.photo, views.expected}) {
    if (std::min(view.width, view.height) < kLeastSide) return std::nullopt;
  }
  return views;
}

}  // namespace

std::optional<Appearance> CompareAppearance(const Features& query, const Features& reference,
                                            const FoundInstance& instance) {
  if (!instance.warp || query.preview.empty() || reference.preview.empty()) return std::nullopt;
  const std::vector<Vec2> seen =
      ConvexHull(PointsOf(reference.keypoints, instance.inliers, &MatchedPair::reference));
  const double scale = ScaleOf(*instance.warp, seen);
  const auto views = ViewsOf(query, reference, scale);
  if (!views) return std::nullopt;
  const auto& [photo, expected] = *views;
  const Mesh mesh =
      WarpMesh(*instance.warp, reference.width, reference.height, kVerify.fine_mesh_points);
  const Rectified found = Rectify(photo, query.width, query.height, mesh, expected);
  const Moments moments = MomentsOf(expected);
  const std::vector<double> correlations = Correlations(expected, moments, found.image);
  double texture = 0;
  double again = 0;
  for (std::size_t at = 0; at < correlations.size(); ++at) {
    if (moments.deviations[at] < kVerify.least_contrast) continue;
    const double weight = std::min(kVerify.most_contrast, moments.deviations[at]);
    texture += weight;
    if (found.visible[at] && correlations[at] > kVerify.agreeing) again += weight;
  }
  if (!(texture > 0)) return std::nullopt;
  return Appearance{
      again / texture,
      RelativeColourDifference(query, reference, mesh, seen, scale),
  };
}

}  // namespace pliant
