// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/tracking/tracking_truth.h"

#include <algorithm>
#include <cstddef>

namespace pliant {

using evaluation::TruthScene;

namespace {

constexpr int kSampleStep = 8;  // pixels of the template

}  // namespace

TemplateTruth FindTemplate(const TruthScene& scene) {
  const Image& view = scene.Picture(0);
  TemplateTruth found;
  found.mask = {view.width, view.height, 1, {}};
  found.mask.pixels.assign(view.pixels.size(), 0);
  int left = view.width, top = view.height, right = -1, bottom = -1;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const Vec2 p{static_cast<double>(x), static_cast<double>(y)};
      if (!scene.OnObject(0, p)) continue;
      found.mask.pixels[static_cast<std::size_t>(y) * view.width + x] = 255;
      left = std::min(left, x), right = std::max(right, x);
      top = std::min(top, y), bottom = y;
      if (x % kSampleStep == 0 && y % kSampleStep == 0) found.samples.push_back(p);
    }
  }
  found.box = {left, top, right - left + 1, bottom - top + 1};
  if (right < 0) return found;
  found.picture = {found.box.width, found.box.height, 1, {}};
  for (int y = top; y <= bottom; ++y) {
    const auto row = view.pixels.begin() + static_cast<std::ptrdiff_t>(y) * view.width;
    found.picture.pixels.insert(found.picture.pixels.end(), row + left, row + right + 1);
  }
  return found;
}

ViewTruth FindSeen(TruthScene& scene, const TemplateTruth& reference, int view) {
  ViewTruth truth;
  Vec2 low{1e9, 1e9};
  Vec2 high{-1e9, -1e9};
  for (const Vec2 p : reference.samples) {
    const auto q = scene.Map(0, p, view);
    if (!q) continue;
    truth.samples.push_back({p.x - reference.box.x, p.y - reference.box.y});
    truth.seen.push_back(*q);
    low = {std::min(low.x, q->x), std::min(low.y, q->y)};
    high = {std::max(high.x, q->x), std::max(high.y, q->y)};
  }
  if (!truth.seen.empty()) truth.size_px = std::max(high.x - low.x, high.y - low.y);
  return truth;
}

}  // namespace pliant
