// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Every stage of the C++ network against the PyTorch model of the same weights: closely in float32,
// and as 8 bits allow in bfloat16, where the processor has products of it.
#include "tests/unit/deal_golden.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "descriptor/deal/kernels.h"
#include "descriptor/deal/network.h"

namespace pliant::deal {
namespace {

constexpr double kTolerance = 1e-4;
constexpr int kThreads = 2;

using Type = dnnl::memory::data_type;

class DealGoldenTest : public ::testing::TestWithParam<std::tuple<std::string, std::string, Type>> {
 protected:
  double Tolerance(double bfloat16) const { return type_ == Type::f32 ? kTolerance : bfloat16; }

  // Rows of unit length, the first of the golden ones.
  void ExpectSameDescriptors(std::span<const float> actual, const std::string& name) const {
    std::vector<float> expected = golden_.tensors.Floats(name);
    expected.resize(actual.size());
    ExpectNear(actual, expected, Tolerance(0.02), name);
    const double dot = std::inner_product(actual.begin(), actual.end(), expected.begin(), 0.0);
    const auto rows = static_cast<double>(actual.size()) / static_cast<double>(network_.dim());
    EXPECT_NEAR(dot / rows, 1, Tolerance(5e-4)) << "mean cosine of " << name;
  }

  const std::string model_ = std::get<0>(GetParam());
  const Type type_ = std::get<2>(GetParam());
  const Golden golden_ = LoadGolden(model_, std::get<1>(GetParam()));
  const DealNetwork& network_ = SharedNetwork(model_, type_);
};

// height x width x channels to channels x height x width.
std::vector<float> ChannelsFirst(const FeatureMap& map) {
  std::vector<float> values;
  values.reserve(map.values.size());
  const auto channels = static_cast<std::size_t>(map.channels);
  for (std::size_t c = 0; c < channels; ++c) {
    for (std::size_t i = c; i < map.values.size(); i += channels) {
      values.push_back(map.values[i]);
    }
  }
  return values;
}

TEST_P(DealGoldenTest, GoldensAreOfTheShippedWeights) {
  ASSERT_FALSE(golden_.keypoints.empty());
  EXPECT_EQ(golden_.tensors.metadata().at("model_sha256"), network_.weights().sha256)
      << "regenerate the goldens with descriptor/training after replacing the weights";
}

TEST_P(DealGoldenTest, Backbone) {
  const FeatureMap map = network_.backbone().Run(DealNetwork::ToImage(golden_.image), kThreads);
  const std::vector<std::int64_t> shape = {map.channels, map.height, map.width};
  EXPECT_EQ(shape, golden_.tensors.tensors().at("backbone").shape);
  ExpectNear(ChannelsFirst(map), golden_.tensors.Floats("backbone"), Tolerance(0.2), "backbone");
}

TEST_P(DealGoldenTest, FeatureSamplerAndLocalization) {
  const FeatureMap map = network_.backbone().Run(DealNetwork::ToImage(golden_.image), kThreads);
  std::vector<float> samples(golden_.keypoints.size() * 25 *
                             static_cast<std::size_t>(map.channels));
  LocalizationNet::Sample(map, golden_.keypoints, samples.data());
  ExpectNear(samples, golden_.tensors.Floats("sampled_features"), Tolerance(0.2),
             "sampled_features");
  const std::vector<float> theta = network_.localization().Theta(map, golden_.keypoints, kThreads);
  ASSERT_EQ(theta.size(), golden_.keypoints.size() * kThetaValues);
  ExpectNear(theta, golden_.tensors.Floats("theta"), Tolerance(0.03), "theta");
}

TEST_P(DealGoldenTest, Displacements) {
  const std::vector<float> theta = golden_.tensors.Floats("theta");
  const std::vector<float> planar = network_.Displacements(theta, kThreads);
  std::vector<float> pairs(planar.size());
  for (std::size_t i = 0; i < golden_.keypoints.size(); ++i) {
    for (std::size_t q = 0; q < kPatchPixels; ++q) {
      pairs[(i * kPatchPixels + q) * 2] = planar[i * 2 * kPatchPixels + q];
      pairs[(i * kPatchPixels + q) * 2 + 1] = planar[(i * 2 + 1) * kPatchPixels + q];
    }
  }
  ExpectNear(pairs, golden_.tensors.Floats("displacement_in_radii"), kTolerance,
             "displacement_in_radii");
}

TEST_P(DealGoldenTest, Patches) {
  const GreyImage image = DealNetwork::ToImage(golden_.image);
  ExpectNear(network_.Patches(image, golden_.keypoints,
                              network_.Displacements(golden_.tensors.Floats("theta"), kThreads), 1,
                              kThreads),
             golden_.tensors.Floats("patches"), kTolerance, "patches");
  ExpectNear(network_.Patches(image, golden_.keypoints, {}, 1, kThreads),
             golden_.tensors.Floats("patches_fixed"), kTolerance, "patches_fixed");
}

TEST_P(DealGoldenTest, DescriptorsOfGoldenPatches) {
  const std::vector<float> patches = golden_.tensors.Floats("patches_fixed");
  ExpectSameDescriptors(network_.DescribePatches(patches, kThreads), "descriptors_fixed");
}

TEST_P(DealGoldenTest, WholeNetwork) {
  for (const bool warp : {true, false}) {
    ExpectSameDescriptors(
        network_.Describe(golden_.image, golden_.keypoints, warp, kOneSupport, kThreads),
        warp ? "descriptors" : "descriptors_fixed");
  }
}

std::vector<Type> Types() {
  if (FastestType() == Type::f32) return {Type::f32};
  return {Type::f32, FastestType()};
}

INSTANTIATE_TEST_SUITE_P(Goldens, DealGoldenTest,
                         ::testing::Combine(::testing::ValuesIn(kModels),
                                            ::testing::ValuesIn(kGoldenSizes),
                                            ::testing::ValuesIn(Types())),
                         [](const auto& golden) {
                           std::string name =
                               std::get<0>(golden.param) + "_" + std::get<1>(golden.param) +
                               (std::get<2>(golden.param) == Type::f32 ? "_f32" : "_bf16");
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST(DealGeometryTest, GridAndBasisAreTheTrainersOwn) {
  const SafetensorsFile golden = SafetensorsFile::Open(std::filesystem::path(PLIANT_SOURCE_DIR) /
                                                       "tests/data/golden_tps.safetensors");
  for (const auto& [spacing, name] :
       {std::pair(RadialSpacing::kLinear, std::string("linear")),
        std::pair(RadialSpacing::kLogarithmic, std::string("logarithmic"))}) {
    const std::string grid = "unit_polar_grid_" + name;
    const std::string basis = "tps_basis_" + name;
    const std::vector<float> planar = UnitPolarGrid(spacing);
    std::vector<float> pairs;
    for (std::size_t q = 0; q < kPatchPixels; ++q) {
      pairs.insert(pairs.end(), {planar[q], planar[kPatchPixels + q]});
    }
    ExpectNear(pairs, golden.Floats(grid), 1e-6, grid);
    ExpectNear(TpsBasis(spacing), golden.Floats(basis), 1e-6, basis);
  }
  EXPECT_NEAR(DisplacementGain(), std::stod(golden.metadata().at("displacement_gain")), 1e-9);
}

}  // namespace
}  // namespace pliant::deal
