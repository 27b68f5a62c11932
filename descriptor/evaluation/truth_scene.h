// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images with ground-truth correspondence between them, from surface coordinates (what each pixel
// shows, and where another image shows the same point of the surface) or from homographies.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "descriptor/image/image.h"
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

// Not thread-safe: data of a view may be created on first use.
class TruthScene {
 public:
  virtual ~TruthScene() = default;

  virtual int views() const = 0;
  virtual const Image& ViewImage(int view) const = 0;  // grey

  // Whether the point (pixels of `view`) is on the object: elsewhere the truth is unknown.
  virtual bool OnObject(int view, Vec2 p) const = 0;

  // Where the point of view `from` is seen in view `to`; nothing when it is hidden there, outside
  // the image, or not on the object.
  virtual std::optional<Vec2> Map(int from, Vec2 p, int to) = 0;

  // Whether a keypoint of `view` takes part when `view` is compared with `other`.
  virtual bool Counts(int view, Vec2 p, int /*other*/) { return OnObject(view, p); }
};

// Ground truth from one surface map per view.
class SurfaceScene : public TruthScene {
 public:
  // `max_distance`: see SurfaceIndex.
  explicit SurfaceScene(float max_distance = std::numeric_limits<float>::infinity())
      : max_distance_(max_distance) {}

  void Add(Image grey, SurfaceMap map);

  int views() const override { return static_cast<int>(views_.size()); }
  const Image& ViewImage(int view) const override { return At(view).image; }
  bool OnObject(int view, Vec2 p) const override { return At(view).map.LabelAt(p) != 0; }
  std::optional<Vec2> Map(int from, Vec2 p, int to) override;

 private:
  struct View {
    Image image;
    SurfaceMap map;
    std::unique_ptr<SurfaceIndex> index;  // created by the first search
  };
  View& At(int view) const { return *views_[static_cast<std::size_t>(view)]; }

  float max_distance_;
  std::vector<std::unique_ptr<View>> views_;  // pointers: the index refers to the map
};

// 3 x 3, row-major: pixel positions to pixel positions.
using Homography = std::array<double, 9>;

// A flat scene: every view is a homography of view 0. Everything is the object; a keypoint counts
// in a pair when its place lies within the other image's frame (Mikolajczyk et al., IJCV 2005).
class HomographyScene : public TruthScene {
 public:
  // `from_first[k]` maps view 0 to view k. Throws kInvalidArgument "homography_singular".
  HomographyScene(std::vector<Image> images, const std::vector<Homography>& from_first);

  int views() const override { return static_cast<int>(images_.size()); }
  const Image& ViewImage(int view) const override {
    return images_[static_cast<std::size_t>(view)];
  }
  bool OnObject(int /*view*/, Vec2 /*p*/) const override { return true; }
  std::optional<Vec2> Map(int from, Vec2 p, int to) override;
  bool Counts(int view, Vec2 p, int other) override { return Map(view, p, other).has_value(); }

 private:
  std::vector<Image> images_;
  std::vector<Homography> from_first_;
  std::vector<Homography> to_first_;
};

}  // namespace pliant::evaluation
