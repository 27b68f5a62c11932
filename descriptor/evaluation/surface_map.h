// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ground truth from surface coordinates: what each pixel of an image shows, and where in another
// image the same point of the surface is seen.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "descriptor/warp/tps.h"

namespace pliant::evaluation {

// A point of a surface: which one, and where on it (two or three coordinates; unused ones are 0).
struct SurfacePoint {
  std::uint32_t label = 0;  // 0 = no surface
  std::array<float, 3> at = {};
};

// One SurfacePoint per pixel, that of the pixel's centre.
struct SurfaceMap {
  int width = 0;
  int height = 0;
  std::vector<SurfacePoint> points;  // height x width, row-major

  const SurfacePoint& Pixel(int x, int y) const {
    return points[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
  // Label of the pixel that holds p; 0 outside the image.
  std::uint32_t LabelAt(Vec2 p) const;
  // The surface point at p, extrapolated linearly from the nearest pixel. nullopt off the surfaces.
  std::optional<SurfacePoint> Locate(Vec2 p) const;
};

// Gradient of the surface coordinates at a pixel. Where the two sides differ (a fold, a seam, a
// silhouette) the smaller difference is used; nullopt where no neighbour shows the same surface.
struct SurfaceSlope {
  std::array<float, 3> x = {};  // per pixel to the right
  std::array<float, 3> y = {};  // per pixel down
};
std::optional<SurfaceSlope> SlopeAt(const SurfaceMap& map, int x, int y);

// Finds surface points in an image (a k-d tree over its pixels). Immutable and thread-safe; `map`
// must outlive it.
class SurfaceIndex {
 public:
  // Points whose nearest pixel is further away than `max_distance` (coordinates) are not found.
  explicit SurfaceIndex(const SurfaceMap& map,
                        float max_distance = std::numeric_limits<float>::infinity());

  // The position of the point, with sub-pixel accuracy; nullopt when it is hidden, faces away or is
  // outside the image (nearest pixel that shows its neighbourhood more than a pixel away).
  std::optional<Vec2> Find(const SurfacePoint& point) const;

 private:
  struct Entry {
    std::array<float, 4> key;  // coordinates, then the label, far apart
    std::uint32_t pixel = 0;
  };
  struct Nearest {
    float squared_distance;
    std::uint32_t pixel;
  };
  void Build(std::size_t begin, std::size_t end);
  void Search(std::size_t begin, std::size_t end, const std::array<float, 4>& key,
              Nearest& nearest) const;

  const SurfaceMap& map_;
  float max_distance_;
  std::vector<Entry> entries_;      // of a range, the middle one splits it
  std::vector<std::uint8_t> axis_;  // along which entry i splits its range
};

}  // namespace pliant::evaluation
