// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images bent by a known smooth map, as frames of a video would show them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

#include "descriptor/image/image.h"
#include "descriptor/warp/tps.h"

namespace pliant::testing {

// A bend that grows with `amount` (0 = none), a turn and a shift. Maps frame pixels to template
// pixels, which is what rendering needs.
struct Bend {
  double amount = 1;
  double turn_deg = 0;
  Vec2 shift;
  Vec2 centre{200, 150};

  Vec2 ToTemplate(Vec2 p) const {
    const double angle = turn_deg * 3.14159265358979 / 180;
    const double x = p.x - centre.x - shift.x;
    const double y = p.y - centre.y - shift.y;
    const Vec2 q{centre.x + std::cos(angle) * x + std::sin(angle) * y,
                 centre.y - std::sin(angle) * x + std::cos(angle) * y};
    return {q.x + amount * 9 * std::sin(q.y / 45), q.y + amount * 7 * std::cos(q.x / 50)};
  }
  // The inverse, by Newton's method with a numeric Jacobian.
  Vec2 ToFrame(Vec2 t) const {
    Vec2 p = t;
    for (int i = 0; i < 30; ++i) {
      const Vec2 f = ToTemplate(p);
      const Vec2 fx = ToTemplate({p.x + 0.5, p.y});
      const Vec2 fy = ToTemplate({p.x, p.y + 0.5});
      const double a = (fx.x - f.x) * 2, b = (fy.x - f.x) * 2;
      const double c = (fx.y - f.y) * 2, d = (fy.y - f.y) * 2;
      const double det = a * d - b * c;
      p.x -= (d * (f.x - t.x) - b * (f.y - t.y)) / det;
      p.y -= (a * (f.y - t.y) - c * (f.x - t.x)) / det;
    }
    return p;
  }
};

// Random discs, large ones first: a keypoint every few pixels.
inline Image RichImage(std::uint64_t seed, int width = 400, int height = 300) {
  std::mt19937_64 random(seed);
  Image image{width, height, 1, {}};
  image.pixels.assign(static_cast<std::size_t>(width) * height, 128);
  constexpr int kDiscs = 1500;
  for (int disc = 0; disc < kDiscs; ++disc) {
    const int cx = static_cast<int>(random() % static_cast<unsigned>(width));
    const int cy = static_cast<int>(random() % static_cast<unsigned>(height));
    const int most = 3 + 10 * (kDiscs - disc) / kDiscs;
    const int radius = 2 + static_cast<int>(random() % static_cast<unsigned>(most));
    const auto grey = static_cast<std::uint8_t>(random() % 256);
    for (int y = std::max(0, cy - radius); y < std::min(height, cy + radius); ++y) {
      for (int x = std::max(0, cx - radius); x < std::min(width, cx + radius); ++x) {
        if ((x - cx) * (x - cx) + (y - cy) * (y - cy) >= radius * radius) continue;
        image.pixels[static_cast<std::size_t>(y) * width + x] = grey;
      }
    }
  }
  return image;
}

// The template as the bend shows it, on grey.
inline Image BentImage(const Image& reference, const Bend& bend) {
  Image frame{reference.width, reference.height, 1, {}};
  frame.pixels.assign(reference.pixels.size(), 100);
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      const Vec2 t = bend.ToTemplate({static_cast<double>(x), static_cast<double>(y)});
      if (t.x < 0 || t.y < 0 || t.x >= reference.width - 1.0 || t.y >= reference.height - 1.0) {
        continue;
      }
      const int tx = static_cast<int>(t.x);
      const int ty = static_cast<int>(t.y);
      const auto at = [&](int dx, int dy) {
        return static_cast<double>(
            reference.pixels[static_cast<std::size_t>(ty + dy) * reference.width + tx + dx]);
      };
      const double fx = t.x - tx;
      const double fy = t.y - ty;
      frame.pixels[static_cast<std::size_t>(y) * frame.width + x] =
          static_cast<std::uint8_t>(std::lround((1 - fy) * ((1 - fx) * at(0, 0) + fx * at(1, 0)) +
                                                fy * ((1 - fx) * at(0, 1) + fx * at(1, 1))));
    }
  }
  return frame;
}

}  // namespace pliant::testing
