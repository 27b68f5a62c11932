// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Parts of images.
#pragma once

namespace pliant {

// A rectangle in pixels of an image, which it may reach beyond. Pixel centres are at integer
// coordinates: the image's own first pixel reaches from -0.5 to 0.5.
struct Region {
  double x = 0, y = 0, width = 0, height = 0;
};

// A rectangle of whole pixels.
struct PixelBox {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
};

inline bool Contains(const Region& region, double x, double y) {
  return x >= region.x && x < region.x + region.width && y >= region.y &&
         y < region.y + region.height;
}

// The same part once the image is scaled.
inline Region Scaled(const Region& region, double scale) {
  return {(region.x + 0.5) * scale - 0.5, (region.y + 0.5) * scale - 0.5, region.width * scale,
          region.height * scale};
}

// The same part in pixels of what is cut out of the image from (left, top) on.
inline Region SeenFrom(const Region& region, int left, int top) {
  return {region.x - left, region.y - top, region.width, region.height};
}

}  // namespace pliant
