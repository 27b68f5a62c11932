// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/appearance.h"

#include <functional>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pliant {
namespace {

constexpr int kSide = 128;  // of a preview
constexpr int kScale = 5;   // pixels of the image per pixel of its preview
constexpr unsigned kSeed = 7;

using Grey = std::function<int(int x, int y)>;  // of a preview

// Blocks of random grey values; another `design` has others.
Grey Print(unsigned design) {
  std::mt19937 random(kSeed + design);
  std::vector<int> blocks(16 * 16);
  for (int& grey : blocks) grey = static_cast<int>(random() % 200) + 20;
  return [blocks](int x, int y) { return blocks[static_cast<std::size_t>((y / 8) * 16 + x / 8)]; };
}

Features Seen(const Grey& grey) {
  Features features;
  features.width = features.height = kSide * kScale;
  Image preview{kSide, kSide, 1, {}};
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      preview.pixels.push_back(static_cast<std::uint8_t>(grey(x, y)));
    }
  }
  features.preview = EncodeJpeg(preview);
  return features;
}

// Enlarges `scale` times, then moves.
ThinPlateSpline Warp(double scale, Vec2 by) {
  const std::vector<Vec2> from = {{0, 0}, {600, 0}, {0, 600}, {600, 600}};
  std::vector<Vec2> to;
  for (const Vec2 p : from) to.push_back({scale * p.x + by.x, scale * p.y + by.y});
  return ThinPlateSpline::Fit(from, to);
}

std::optional<Appearance> Compare(const Features& query, const Features& reference,
                                  double scale = 1, Vec2 by = {}) {
  FoundInstance found;
  Features matched = reference;
  for (const float x : {40.0F, 600.0F}) {
    for (const float y : {40.0F, 600.0F}) {
      found.inliers.push_back({0, static_cast<std::uint32_t>(matched.keypoints.size())});
      matched.keypoints.push_back({.x = x, .y = y});
    }
  }
  found.warp = Warp(scale, by);
  return CompareAppearance(query, matched, found);
}

TEST(Appearance, OfTheSameAgreesInAnyLight) {
  const Grey print = Print(0);
  const Features dark = Seen([&](int x, int y) { return print(x, y) / 2 + 10; });
  const Appearance same = Compare(dark, Seen(print)).value();
  EXPECT_GT(same.seen_again, 0.95);
}

TEST(Appearance, OfASiblingAgreesInPart) {
  const Grey print = Print(0);
  const Grey other = Print(1);
  const Features sibling = Seen([&](int x, int y) { return y < 64 ? print(x, y) : other(x, y); });
  const Appearance half = Compare(sibling, Seen(print)).value();
  EXPECT_NEAR(half.seen_again, 0.5, 0.15);
}

TEST(Appearance, LooksWhereTheWarpSays) {
  const Grey print = Print(0);
  const Features moved =
      Seen([&](int x, int y) { return x < 16 ? 255 : print(x - 16, y); });  // 80 pixels
  EXPECT_GT(Compare(moved, Seen(print), 1, {80, 0}).value().seen_again, 0.8);
  EXPECT_LT(Compare(moved, Seen(print)).value().seen_again, 0.3);
}

TEST(Appearance, OutsideThePhotoIsNotSeenAgain) {
  const Grey print = Print(0);
  const Features half = Seen([&](int x, int y) { return print(std::min(x + 64, kSide - 1), y); });
  const Appearance right = Compare(half, Seen(print), 1, {-320, 0}).value();
  EXPECT_NEAR(right.seen_again, 0.5, 0.1);
}

TEST(Appearance, ComparesAtTheCoarserResolution) {
  const Grey print = Print(0);
  // The query shows it at a third of the size, without its details.
  const Features small =
      Seen([&](int x, int y) { return x < 42 && y < 42 ? print(3 * x + 1, 3 * y + 1) : 128; });
  EXPECT_GT(Compare(small, Seen(print), 1.0 / 3).value().seen_again, 0.8);
}

TEST(Appearance, IsUnknownWithoutPreviewsTextureOrPixels) {
  const Features print = Seen(Print(0));
  Features none = print;
  none.preview = {};
  EXPECT_FALSE(Compare(none, print));
  EXPECT_FALSE(Compare(print, none));
  EXPECT_FALSE(Compare(print, Seen([](int, int) { return 90; })));
  EXPECT_FALSE(Compare(print, print, 0.1)) << "12 pixels";
}

}  // namespace
}  // namespace pliant
