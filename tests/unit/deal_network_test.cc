// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The network away from the goldens: concurrency, several supports, odd inputs.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <thread>

#include "descriptor/base/error.h"
#include "descriptor/features/descriptor.h"
#include "tests/unit/deal_golden.h"
#include "tests/unit/wavy_image.h"

namespace pliant::deal {
namespace {

constexpr std::uint32_t kSeed = 77;

Image RandomImage(int width, int height) { return testing::WavyImage(width, height, 5, 4, kSeed); }

std::vector<Keypoint> RandomKeypoints(std::size_t count, int width, int height) {
  std::mt19937 random(kSeed + 1);
  std::vector<Keypoint> points(count);
  for (Keypoint& point : points) {
    point.x = static_cast<float>(random() % 1000) / 1000 * static_cast<float>(width - 1);
    point.y = static_cast<float>(random() % 1000) / 1000 * static_cast<float>(height - 1);
    point.size = 2 + static_cast<float>(random() % 100) / 10;
  }
  return points;
}

TEST(DealNetworkTest, ConcurrentCallersGetTheSingleCallersBits) {
  const Image image = RandomImage(131, 97);
  const std::vector<Keypoint> points = RandomKeypoints(70, 131, 97);
  const std::vector<float> expected = SharedNetwork().Describe(image, points, true, kOneSupport, 1);
  std::vector<std::vector<float>> results(6);
  {
    std::vector<std::jthread> callers;
    for (auto& result : results) {
      callers.emplace_back([&] {
        for (int round = 0; round < 3; ++round) {
          result = SharedNetwork().Describe(image, points, true, kOneSupport, 1);
        }
      });
    }
  }
  for (const auto& result : results) EXPECT_EQ(result, expected);
  ExpectNear(SharedNetwork().Describe(image, points, true, kOneSupport, 3), expected, 1e-4,
             "three threads");
}

TEST(DealNetworkTest, ADescriptorDoesNotDependOnItsNeighbours) {
  const Image image = RandomImage(120, 90);
  const std::vector<Keypoint> points = RandomKeypoints(150, 120, 90);
  const std::vector<float> all = SharedNetwork().Describe(image, points, true, kOneSupport, 1);
  for (const std::size_t count : {1U, 15U, 17U, 64U, 129U}) {
    const std::vector<Keypoint> last(points.end() - static_cast<long>(count), points.end());
    const std::vector<float> rows = SharedNetwork().Describe(image, last, true, kOneSupport, 1);
    ExpectNear(rows, std::span(all).last(rows.size()), 1e-5, std::to_string(count));
  }
}

TEST(DealNetworkTest, SeveralSupportsAreTheirDescriptorsMean) {
  const Image image = RandomImage(120, 90);
  const std::vector<Keypoint> points = RandomKeypoints(35, 120, 90);
  for (const bool warp : {false, true}) {
    std::vector<float> expected(points.size() * SharedNetwork().dim());
    for (const float support : kPooledSupports) {
      const std::vector<float> one =
          SharedNetwork().Describe(image, points, warp, std::span(&support, 1), 1);
      for (std::size_t i = 0; i < one.size(); ++i) expected[i] += one[i];
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto row =
          std::span(expected).subspan(i * SharedNetwork().dim(), SharedNetwork().dim());
      const double square = std::inner_product(row.begin(), row.end(), row.begin(), 0.0);
      for (float& value : row) value = static_cast<float>(value / std::sqrt(square));
    }
    ExpectNear(SharedNetwork().Describe(image, points, warp, kPooledSupports, 1), expected, 1e-5,
               "pooled");
  }
}

// What pooling is for: a keypoint whose size was misjudged.
TEST(DealNetworkTest, PoolingForgivesWrongSizes) {
  const Image image = RandomImage(240, 180);
  const std::vector<Keypoint> points = RandomKeypoints(60, 240, 180);
  std::vector<Keypoint> larger = points;
  for (Keypoint& point : larger) point.size *= 1.35F;
  const auto agreement = [&](std::span<const float> supports) {
    const std::vector<float> a = SharedNetwork().Describe(image, points, true, supports, 1);
    const std::vector<float> b = SharedNetwork().Describe(image, larger, true, supports, 1);
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0) /
           static_cast<double>(points.size());
  };
  EXPECT_GT(agreement(kPooledSupports), agreement(kOneSupport) + 0.02);
}

TEST(DealNetworkTest, TinyAndOddImages) {
  for (const auto& [width, height] :
       {std::pair{16, 16}, {17, 31}, {1, 1}, {1, 40}, {33, 2}, {257, 19}}) {
    const Image image = RandomImage(width, height);
    for (const bool warp : {false, true}) {
      const std::vector<float> rows =
          SharedNetwork().Describe(image, RandomKeypoints(5, width, height), warp, kOneSupport, 2);
      ASSERT_EQ(rows.size(), 5U * SharedNetwork().dim());
      for (std::size_t i = 0; i < 5; ++i) {
        double squared = 0;
        for (std::size_t d = 0; d < SharedNetwork().dim(); ++d) {
          squared += std::pow(rows[i * SharedNetwork().dim() + d], 2);
        }
        EXPECT_NEAR(squared, 1, 1e-4) << width << " x " << height;
      }
    }
  }
}

TEST(DealNetworkTest, KeypointsOutsideAndHuge) {
  const Image image = RandomImage(64, 48);
  std::vector<Keypoint> points(6);
  for (Keypoint& point : points) point.size = 4;
  points[1] = {.x = -500, .y = 1e9F, .size = 3};
  points[2] = {.x = 63, .y = 47, .size = 5};
  points[3] = {.x = 20, .y = 20, .size = 1e30F};
  points[4] = {.x = 20, .y = 20, .size = std::numeric_limits<float>::max()};
  points[5] = {.x = 20, .y = 20, .size = 1e-30F};
  for (const bool warp : {false, true}) {
    for (const float value : SharedNetwork().Describe(image, points, warp, kOneSupport, 2)) {
      ASSERT_TRUE(std::isfinite(value));
    }
  }
}

TEST(DealNetworkTest, RefusesKeypointsAndImagesByName) {
  const Image image = RandomImage(64, 48);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  for (const Keypoint& bad :
       {Keypoint{.x = kNan, .size = 1}, Keypoint{.y = -kInfinity, .size = 1}, Keypoint{.size = 0},
        Keypoint{.size = -2}, Keypoint{.size = kNan}, Keypoint{.size = kInfinity}}) {
    const std::vector<Keypoint> points = {Keypoint{.size = 3}, bad};
    try {
      SharedNetwork().Describe(image, points, false, kOneSupport, 1);
      ADD_FAILURE() << "described a bad keypoint";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
      EXPECT_NE(std::string(error.what()).find("keypoint 1"), std::string::npos);
    }
  }
  Image colour = image;
  colour.channels = 3;
  EXPECT_THROW(SharedNetwork().Describe(colour, {}, false, kOneSupport, 1), Error);
  EXPECT_THROW(SharedNetwork().Describe(Image{}, {}, false, kOneSupport, 1), Error);
}

// Patches come from the finer image, warps from the given one.
TEST(DealNetworkTest, DescribesKeypointsOfFinerImages) {
  const Image image = RandomImage(96, 80);
  const Image twice = ResizeImage(image, 192, 160);
  const std::vector<Keypoint> points = RandomKeypoints(40, 96, 80);
  EnlargedKeypoints finer;
  finer.image = twice;
  for (const Keypoint& k : RandomKeypoints(30, 192, 160)) {
    finer.inside.push_back(k);
    finer.placed.push_back(k);
  }
  ScaleToOriginal(finer.placed, 2);
  const auto describe = [](const Image& from, std::span<const Keypoint> keypoints, bool warp,
                           std::span<const EnlargedKeypoints> more) {
    return SharedNetwork().Describe(from, keypoints, warp, kOneSupport, 1, more);
  };
  const auto join = [](std::vector<float> first, const std::vector<float>& second) {
    first.insert(first.end(), second.begin(), second.end());
    return first;
  };
  ExpectNear(describe(image, points, false, {&finer, 1}),
             join(describe(image, points, false, {}), describe(twice, finer.inside, false, {})),
             1e-5, "without warps");
  const std::vector<float> rows = describe(image, points, true, {&finer, 1});
  const std::vector<float> own = describe(image, points, true, {});
  ExpectNear(std::span(rows).first(own.size()), own, 1e-5, "own keypoints");
  const std::vector<float> fixed = describe(twice, finer.inside, false, {});
  const auto more = std::span(rows).last(fixed.size());
  EXPECT_FALSE(std::ranges::equal(more, fixed));
  // The same image: as if they were its own.
  finer.image = image;
  finer.inside = finer.placed;
  std::vector<Keypoint> all = points;
  all.insert(all.end(), finer.placed.begin(), finer.placed.end());
  ExpectNear(describe(image, points, true, {&finer, 1}), describe(image, all, true, {}), 1e-5,
             "one image");
  // More of the finer image's detail, so much alike, but not the same.
  const std::vector<float> coarse = describe(image, finer.placed, true, {});
  double alike = 0;
  for (std::size_t i = 0; i < coarse.size(); ++i) alike += coarse[i] * more[i];
  EXPECT_GT(alike / static_cast<double>(finer.placed.size()), 0.8);
  finer.placed[3].x = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(describe(image, points, true, {&finer, 1}), Error);
}

TEST(DealNetworkTest, DescriptorInterface) {
  const auto deal = MakeDescriptor("deal", {ModelPath()});
  const auto small = MakeDescriptor("deal-small", {ModelPath().parent_path()});
  const auto fixed = MakeDescriptor("deal-fixed", {ModelPath()});
  const std::string hash = SharedNetwork().weights().sha256.substr(0, 16);
  EXPECT_EQ(deal->info().model_id, "deal:" + hash);
  EXPECT_EQ(small->info().model_id,
            "deal-small:" + SharedNetwork("deal-small").weights().sha256.substr(0, 16));
  EXPECT_EQ(small->info().dim, 64);
  EXPECT_EQ(fixed->info().model_id, "deal-fixed:" + hash);
  EXPECT_EQ(fixed->info().name, "deal-fixed");
  const Image image = RandomImage(90, 70);
  const Descriptors none = deal->Describe(image, {}, 0);
  EXPECT_EQ(none.rows, 0U);
  EXPECT_EQ(none.dim, 64);
  EXPECT_TRUE(none.floats.empty());
  const std::vector<Keypoint> points = RandomKeypoints(9, 90, 70);
  const Descriptors some = deal->Describe(image, points, 0);
  EXPECT_EQ(some.rows, 9U);
  EXPECT_NE(some.floats, fixed->Describe(image, points, 0).floats);
  EXPECT_EQ(deal->DescribeReference(image, points, 1).floats,
            SharedNetwork().Describe(image, points, true, kPooledSupports, 1));
}

}  // namespace
}  // namespace pliant::deal
