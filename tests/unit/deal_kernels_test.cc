// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The hand-written kernels of every instruction set against plain loops.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>

#include "descriptor/deal/hardnet_body.h"
#include "descriptor/deal/kernels.h"
#include "descriptor/deal/primitives.h"
#include "tests/unit/deal_golden.h"

namespace pliant::deal {
namespace {

constexpr std::uint32_t kSeed = 77;

std::vector<float> Random(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<float> values(count);
  for (float& value : values) value = uniform(random);
  return values;
}

// The oracle: relu(w * x + b), circular in rows, zero outside the columns, stride 1.
std::vector<double> PlainConv(const std::vector<float>& in, int side, const ConvLayer& layer) {
  std::vector<double> out;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      for (int o = 0; o < layer.outputs; ++o) {
        double sum = layer.bias[static_cast<std::size_t>(o)];
        for (int t = 0; t < 9; ++t) {
          const int row = (y + t / 3 - 1 + side) % side;
          const int column = x + t % 3 - 1;
          if (column < 0 || column >= side) continue;
          for (int i = 0; i < layer.inputs; ++i) {
            sum += static_cast<double>(
                       layer.weight[static_cast<std::size_t>((o * layer.inputs + i) * 9 + t)]) *
                   in[static_cast<std::size_t>((row * side + column) * layer.inputs + i)];
          }
        }
        out.push_back(std::max(sum, 0.0));
      }
    }
  }
  return out;
}

ConvLayer RandomLayer(int inputs, int outputs) {
  ConvLayer layer;
  layer.inputs = inputs;
  layer.outputs = outputs;
  layer.kernel_height = layer.kernel_width = 3;
  layer.weight = Random(static_cast<std::size_t>(inputs * outputs) * 9, kSeed + 2);
  layer.bias = Random(static_cast<std::size_t>(outputs), kSeed + 3);
  return layer;
}

// The upper halves of floats, to nearest; halfway to even.
std::vector<std::uint16_t> ToBfloat16(const std::vector<float>& values) {
  std::vector<std::uint16_t> narrow;
  for (const float value : values) {
    const double step = std::ldexp(1.0, std::max(std::ilogb(value), -126) - 7);
    const auto rounded = static_cast<float>(std::nearbyint(value / step) * step);
    narrow.push_back(static_cast<std::uint16_t>(std::bit_cast<std::uint32_t>(rounded) >> 16));
  }
  return narrow;
}

class DealKernelsTest : public ::testing::TestWithParam<const Kernels*> {};

TEST_P(DealKernelsTest, WinogradIsThePlainConvolution) {
  constexpr int kChannels = 32;
  for (const int side : {8, 16}) {
    const ConvLayer layer = RandomLayer(kChannels, kChannels);
    const auto map_size = static_cast<std::size_t>(side * side * kChannels);
    const std::vector<float> in = Random(map_size, kSeed);
    const auto tiles = static_cast<std::size_t>((side / 4) * (side / 4));
    const std::size_t plane = (tiles + 1) * kChannels;
    std::vector<float> v(kTilePlanes * plane);
    std::vector<float> m(kTilePlanes * plane);
    GetParam()->winograd_input(in.data(), side, kChannels, plane, v.data());
    const std::vector<float> u = WinogradWeights(layer);
    for (std::size_t p = 0; p < kTilePlanes; ++p) {
      for (std::size_t t = 0; t < tiles; ++t) {
        for (std::size_t o = 0; o < kChannels; ++o) {
          double sum = 0;
          for (std::size_t i = 0; i < kChannels; ++i) {
            sum += static_cast<double>(v[p * plane + t * kChannels + i]) *
                   u[(p * kChannels + i) * kChannels + o];
          }
          m[p * plane + t * kChannels + o] = static_cast<float>(sum);
        }
      }
    }
    std::vector<float> out(map_size);
    GetParam()->winograd_output(m.data(), side, kChannels, plane, layer.bias.data(), out.data());
    const std::vector<double> expected = PlainConv(in, side, layer);
    for (std::size_t i = 0; i < map_size; ++i) ASSERT_NEAR(out[i], expected[i], 1e-4) << i;

    std::vector<float> pooled(static_cast<std::size_t>(side) * kChannels);
    GetParam()->winograd_pooled(m.data(), side, kChannels, plane, layer.bias.data(), pooled.data());
    for (std::size_t i = 0; i < pooled.size(); ++i) {
      double mean = 0;
      for (std::size_t at = i; at < map_size; at += pooled.size()) mean += expected[at] / side;
      ASSERT_NEAR(pooled[i], mean, 1e-4) << i;
    }
  }
}

TEST_P(DealKernelsTest, FirstConvolutionAndStandardize) {
  std::vector<float> patch = Random(kPatchPixels, kSeed);
  double mean = 0;
  double variance = 0;
  for (const float value : patch) mean += value / kPatchPixels;
  for (const float value : patch) variance += (value - mean) * (value - mean) / kPatchPixels;
  std::vector<float> framed(kFramedPixels, 9.0F);
  GetParam()->standardize(patch.data(), framed.data());
  for (float& value : patch) {
    value = static_cast<float>((value - mean) / std::sqrt(variance + 1e-5));
  }
  for (const int channels : {16, 32, 48}) {
    const auto outputs = static_cast<std::size_t>(channels);
    const ConvLayer layer = RandomLayer(1, channels);
    std::vector<float> taps_first(9 * outputs);
    for (std::size_t i = 0; i < taps_first.size(); ++i) {
      taps_first[i] = layer.weight[i % outputs * 9 + i / outputs];
    }
    const std::vector<double> expected = PlainConv(patch, kPatchSide, layer);
    for (const int stride : {1, 2}) {
      const auto side = static_cast<std::size_t>(kPatchSide / stride);
      std::vector<float> out(side * side * outputs);
      GetParam()->first_conv(framed.data(), channels, stride, taps_first.data(), layer.bias.data(),
                             out.data());
      std::vector<std::uint16_t> narrow(out.size());
      GetParam()->first_conv_bfloat16(framed.data(), channels, stride, taps_first.data(),
                                      layer.bias.data(), narrow.data());
      EXPECT_EQ(narrow, ToBfloat16(out));
      for (std::size_t i = 0; i < out.size(); ++i) {
        const std::size_t pixel = i / outputs;
        const std::size_t at = (pixel / side * kPatchSide + pixel % side) * stride;
        ASSERT_NEAR(out[i], expected[at * outputs + i % outputs], 1e-4) << i;
      }
    }
  }
}

TEST_P(DealKernelsTest, SamplersAgreeWithTheBaseline) {
  const Kernels& baseline = *UsableKernels().back();
  constexpr int kHeight = 9;
  constexpr int kWidth = 7;
  constexpr int kChannels = 48;
  const std::vector<float> map = Random(kHeight * kWidth * kChannels, kSeed);
  const std::vector<float> image = Random(kHeight * kWidth, kSeed);
  const std::vector<float> grid = Random(2 * kPatchPixels, kSeed + 5);
  for (const float at : {-1e30F, -3.0F, 0.0F, 2.3F, 6.0F, 50.0F, 1e30F}) {
    std::vector<float> a(kNeighbours * kNeighbours * kChannels);
    std::vector<float> b(a.size());
    GetParam()->sample_features(map.data(), kHeight, kWidth, kChannels, at, 1.5F, a.data());
    baseline.sample_features(map.data(), kHeight, kWidth, kChannels, at, 1.5F, b.data());
    ExpectNear(a, b, 1e-5, "features");
    std::vector<std::uint16_t> narrow(a.size());
    GetParam()->sample_features_bfloat16(map.data(), kHeight, kWidth, kChannels, at, 1.5F,
                                         narrow.data());
    EXPECT_EQ(narrow, ToBfloat16(a));
    a.resize(kPatchPixels);
    b.resize(kPatchPixels);
    GetParam()->sample_patch(image.data(), kHeight, kWidth, at, 4, 3, grid.data(), nullptr,
                             a.data());
    baseline.sample_patch(image.data(), kHeight, kWidth, at, 4, 3, grid.data(), nullptr, b.data());
    ExpectNear(a, b, 1e-5, "patch");
  }
}

// The one that has just been used is found; of the idle ones the oldest go.
TEST(Pool, KeepsTheLastUsedUpToTheirCosts) {
  Pool<int> pool(10, [](const int& cost) { return static_cast<std::size_t>(cost); });
  const auto is_kept = [&](int cost) {
    bool made = false;
    {
      const auto lease = pool.Take([&](const int& idle) { return idle == cost; },
                                   [&] {
                                     made = true;
                                     return std::make_unique<int>(cost);
                                   });
    }
    return !made;
  };
  EXPECT_FALSE(is_kept(3));
  EXPECT_FALSE(is_kept(4));
  EXPECT_TRUE(is_kept(3));
  EXPECT_FALSE(is_kept(5));  // 3 + 5: 4 goes, which was used before 3
  EXPECT_TRUE(is_kept(3));
  EXPECT_FALSE(is_kept(4));  // 3 + 4: 5 goes
  EXPECT_FALSE(is_kept(11)) << "is too much by itself";
  EXPECT_FALSE(is_kept(11));
  EXPECT_TRUE(is_kept(3)) << "which takes the place of nothing";
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, DealKernelsTest, ::testing::ValuesIn(UsableKernels()),
                         [](const auto& kernels) { return std::string(kernels.param->name); });

}  // namespace
}  // namespace pliant::deal
