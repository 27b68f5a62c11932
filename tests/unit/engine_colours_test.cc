// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Objects whose prints differ by colour only: the same in grey.
#include <algorithm>

#include <gtest/gtest.h>

#include "tests/unit/engine_fixture.h"

namespace pliant {
namespace {

// An image of discs whose left half is tinted red and its right half green, or for tint < 0 the
// other way round. Tints have no grey value.
Image Tinted(std::uint64_t seed, int tint) {
  const Image grey = testing::RandomImage(seed, 320, 240);
  Image image{grey.width, grey.height, 3, {}};
  for (int y = 0; y < grey.height; ++y) {
    for (int x = 0; x < grey.width; ++x) {
      const int level = 64 + grey.pixels[static_cast<std::size_t>(y) * grey.width + x] / 2;
      const int t = x < grey.width / 2 ? tint : -tint;
      image.pixels.push_back(static_cast<std::uint8_t>(level + 2 * t));
      image.pixels.push_back(static_cast<std::uint8_t>(level - t));
      image.pixels.push_back(static_cast<std::uint8_t>(level));
    }
  }
  return image;
}

// Shifted, darker, and, if it has colours, in yellow light.
Image OtherView(const Image& image) {
  Image view = image;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const auto pixel = [&](int column, int row) {
        return static_cast<std::size_t>(image.channels) *
               (static_cast<std::size_t>(row) * image.width + static_cast<std::size_t>(column));
      };
      for (int c = 0; c < image.channels; ++c) {
        const int from = image.pixels[pixel(std::max(0, x - 5), std::max(0, y - 3)) + c];
        view.pixels[pixel(x, y) + c] = static_cast<std::uint8_t>(from * (c == 2 ? 7 : 9) / 10);
      }
    }
  }
  return view;
}

// Two images of one height in one, with a grey gap.
Image Beside(const Image& left, const Image& right) {
  constexpr int kGap = 60;
  Image both{left.width + kGap + right.width, left.height, 3, {}};
  const auto row_of = [](const Image& image, int y) {
    return image.pixels.begin() + std::ptrdiff_t{3} * y * image.width;
  };
  for (int y = 0; y < both.height; ++y) {
    both.pixels.insert(both.pixels.end(), row_of(left, y), row_of(left, y + 1));
    both.pixels.insert(both.pixels.end(), 3 * kGap, 100);
    both.pixels.insert(both.pixels.end(), row_of(right, y), row_of(right, y + 1));
  }
  return both;
}

double CentreX(const Hit& hit) {
  double sum = 0;
  for (const Point p : hit.polygon) sum += p.x;
  return sum / static_cast<double>(hit.polygon.size());
}

class EngineColoursTest : public testing::EngineTest {
 protected:
  EngineColoursTest() {
    Add(engine_, EncodePng(Tinted(1, 16)), "red_left");
    Add(engine_, EncodePng(Tinted(1, -16)), "red_right");
    for (std::uint64_t other = 2; other < 6; ++other) {
      Add(engine_, EncodePng(Tinted(other, 16)), "other" + std::to_string(other));
    }
    Train(engine_, 16);
  }
  SearchResult Search(const Image& query) {
    SearchOptions options;
    options.explain = true;
    return engine_.Search(EncodePng(query), options);
  }

  Engine engine_{Options()};
};

TEST_F(EngineColoursTest, TheRightColoursAreFound) {
  for (const int tint : {16, -16}) {
    const SearchResult result = Search(OtherView(Tinted(1, tint)));
    ASSERT_GE(result.hits.size(), 2U);
    EXPECT_EQ(result.hits[0].object, tint > 0 ? "red_left" : "red_right");
    EXPECT_EQ(result.found, 1U);
    EXPECT_LT(result.hits[1].probability.value(), 0.1);
    ASSERT_TRUE(result.hits[0].explanation && result.hits[1].explanation);
    EXPECT_LT(result.hits[0].explanation->colour_difference.value(), 6);
    EXPECT_GT(result.hits[1].explanation->colour_difference.value(), 20);
  }
}

TEST_F(EngineColoursTest, SideBySideEachIsFoundInItsPlace) {
  for (const int tint : {16, -16}) {
    const SearchResult result = Search(Beside(Tinted(1, tint), Tinted(1, -tint)));
    ASSERT_GE(result.hits.size(), 2U);
    EXPECT_EQ(result.found, 2U);
    for (const Hit& hit : {result.hits[0], result.hits[1]}) {
      SCOPED_TRACE(hit.object);
      const bool is_left = (hit.object == "red_left") == (tint > 0);
      ASSERT_EQ(hit.instances.size(), 1U);
      EXPECT_NEAR(CentreX(hit), is_left ? 160 : 540, 10);
      ASSERT_TRUE(hit.explanation);
      EXPECT_LT(hit.explanation->colour_difference.value(), 6);
      EXPECT_EQ(hit.explanation->inliers.size(), static_cast<std::size_t>(hit.inliers));
    }
  }
}

TEST_F(EngineColoursTest, ToAGreyQueryTheyAreAlike) {
  const SearchResult result = Search(OtherView(ToGrey(Tinted(1, 16))));
  ASSERT_GE(result.hits.size(), 3U);
  EXPECT_NEAR(result.hits[0].score, result.hits[1].score, 1e-3);
  EXPECT_NEAR(result.hits[0].probability.value(), result.hits[1].probability.value(), 0.02);
  EXPECT_FALSE(result.hits[0].explanation->colour_difference);
  EXPECT_NE(result.hits[2].object.substr(0, 3), "red");
}

}  // namespace
}  // namespace pliant
