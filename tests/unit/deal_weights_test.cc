// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The weights of a file: sound ones are read, everything else is refused by name.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/safetensors.h"
#include "descriptor/deal/weights.h"

namespace pliant::deal {
namespace {

using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;

std::vector<std::uint8_t> FileOf(const std::string& header, const std::vector<std::uint8_t>& data) {
  const std::uint64_t length = header.size();
  std::vector<std::uint8_t> bytes(sizeof(length) + header.size() + data.size());
  std::memcpy(bytes.data(), &length, sizeof(length));
  std::copy(header.begin(), header.end(), bytes.begin() + sizeof(length));
  std::copy(data.begin(), data.end(), bytes.end() - static_cast<long>(data.size()));
  return bytes;
}

std::string Fault(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << error.what();
    EXPECT_EQ(error.reason(), "model_corrupt");
    return error.what();
  }
  return "(nothing thrown)";
}

// The shipped file, taken apart to be put together differently.
class DealWeightsTest : public ::testing::Test {
 protected:
  DealWeightsTest() {
    const SafetensorsFile& shipped = Shipped();
    std::uint64_t length = 0;
    std::memcpy(&length, shipped.bytes().data(), 8);
    const char* text = reinterpret_cast<const char*>(shipped.bytes().data()) + 8;
    header_ = Json::parse(text, text + length);
    for (auto& [name, entry] : header_.items()) {  // all in single precision
      if (name == "__metadata__") continue;
      const std::vector<float> values = shipped.Floats(name);
      const auto* bytes = reinterpret_cast<const std::uint8_t*>(values.data());
      const std::size_t begin = data_.size();
      data_.insert(data_.end(), bytes, bytes + values.size() * sizeof(float));
      entry["dtype"] = "F32";
      entry["data_offsets"] = {begin, data_.size()};
    }
  }

  static const SafetensorsFile& Shipped() {
    static const SafetensorsFile file =
        SafetensorsFile::Open(PLIANT_SOURCE_DIR "/descriptor/model/deal.safetensors");
    return file;
  }

  std::string LoadFault() const {
    return Fault([&] {
      ParseDealWeights(SafetensorsFile::Parse(FileOf(header_.dump(), data_), "w.safetensors"));
    });
  }

  void SetFloat(const std::string& tensor, float value) {
    const auto begin = header_.at(tensor).at("data_offsets").at(0).get<std::size_t>();
    std::memcpy(data_.data() + begin, &value, sizeof(value));
  }

  // Gives the tensor another name in its place.
  void Rename(const std::string& from, const std::string& to) {
    header_[to] = header_.at(from);
    header_.erase(from);
  }

  Json header_;
  std::vector<std::uint8_t> data_;
};

TEST_F(DealWeightsTest, ReadsTheShippedFile) {
  const DealWeights weights = ParseDealWeights(Shipped());
  EXPECT_EQ(weights.blocks.size(), 7U);
  EXPECT_EQ(weights.stem.inputs, 1);
  EXPECT_EQ(weights.stem.weight.size(), 64U * 49);
  EXPECT_EQ(weights.localization.front().inputs, 25 * 128);
  EXPECT_EQ(weights.localization.back().outputs, kThetaValues);
  EXPECT_GT(weights.radius_per_size, 0);
  EXPECT_EQ(weights.sha256.size(), 64U);
}

TEST_F(DealWeightsTest, RingsAreAtEqualDistancesWhereNothingElseIsSaid) {
  const auto spacing = [&] {
    return ParseDealWeights(SafetensorsFile::Parse(FileOf(header_.dump(), data_), "w.safetensors"))
        .radial_spacing;
  };
  header_["__metadata__"].erase("radial_spacing");
  EXPECT_EQ(spacing(), RadialSpacing::kLinear);
  header_["__metadata__"]["radial_spacing"] = "linear";
  EXPECT_EQ(spacing(), RadialSpacing::kLinear);
  header_["__metadata__"]["radial_spacing"] = "logarithmic";
  EXPECT_EQ(spacing(), RadialSpacing::kLogarithmic);
}

TEST_F(DealWeightsTest, NamesMissingAndUnknownTensors) {
  Rename("hardnet.conv6.weight", "extra");
  EXPECT_THAT(LoadFault(), HasSubstr("hardnet should have 4 or 6 convolutions, found 5"));
  Rename("extra", "hardnet.conv6.weight");
  Rename("hardnet.conv6.weight", "hardnet.conv7.weight");
  EXPECT_THAT(LoadFault(), HasSubstr("'hardnet.conv6.weight' is missing"));
  Rename("hardnet.conv7.weight", "hardnet.conv6.weight");
  EXPECT_EQ(LoadFault(), "(nothing thrown)");
  header_["extra"] = {{"dtype", "F32"}, {"shape", {0}}, {"data_offsets", {0, 0}}};
  EXPECT_THAT(LoadFault(), HasSubstr("'extra' is unknown"));
}

TEST_F(DealWeightsTest, NamesWrongShapes) {
  header_["hardnet.conv1.weight"]["shape"] = {32, 9};
  EXPECT_THAT(LoadFault(), HasSubstr("'hardnet.conv1.weight' should have 4 axes"));
  header_["hardnet.conv1.weight"]["shape"] = {32, 9, 1, 1};
  EXPECT_THAT(LoadFault(), HasSubstr("'hardnet.conv1.weight' should have shape [32, 1, 3, 3]"));
  header_["hardnet.conv1.weight"]["shape"] = {36, 8, 1, 1};
  EXPECT_THAT(LoadFault(), HasSubstr("'hardnet.conv1.weight' should have 4 axes, the first a "
                                     "multiple of 16 up to 1024, found [36, 8, 1, 1]"));
  header_["hardnet.conv1.weight"]["shape"] = {32, 1, 3, 3};
  header_["hardnet.head1.weight"]["shape"] = {64, 128, 1, 8};
  EXPECT_EQ(LoadFault(), "(nothing thrown)");
  header_["hardnet.head1.weight"]["shape"] = {64, 128, 8, 1};
  EXPECT_THAT(LoadFault(), HasSubstr("'hardnet.head1.weight' should cover 2 to 8 columns"));
}

TEST_F(DealWeightsTest, LocalizationWidthsMustChain) {
  const auto count = header_["localization.fc2.weight"]["shape"][0].get<int>();
  const auto inputs = header_["localization.fc2.weight"]["shape"][1].get<int>();
  header_["localization.fc2.weight"]["shape"] = {count * 2, inputs / 2};
  EXPECT_THAT(LoadFault(), HasSubstr("'localization.fc2.weight' should have shape"));
}

TEST_F(DealWeightsTest, RefusesOtherTypesAndValuesThatAreNotFinite) {
  header_["hardnet.conv2.weight"]["dtype"] = "I32";
  EXPECT_THAT(LoadFault(), HasSubstr("'hardnet.conv2.weight' is of type I32"));
  header_["hardnet.conv2.weight"]["dtype"] = "F32";
  SetFloat("localization.fc3.weight", std::numeric_limits<float>::quiet_NaN());
  EXPECT_THAT(LoadFault(), HasSubstr("'localization.fc3.weight' holds NaN"));
  SetFloat("localization.fc3.weight", std::numeric_limits<float>::infinity());
  EXPECT_THAT(LoadFault(), HasSubstr("'localization.fc3.weight' holds NaN or infinity"));
  SetFloat("localization.fc3.weight", 0);
  SetFloat("backbone.bn1.running_var", -1);
  EXPECT_THAT(LoadFault(), HasSubstr("'backbone.bn1.running_var' holds a negative variance"));
}

TEST_F(DealWeightsTest, ChecksMetadata) {
  for (const char* bad : {"", "0", "-3", "nan", "inf", "9 px", "1e9"}) {
    header_["__metadata__"]["radius_per_size"] = bad;
    EXPECT_THAT(LoadFault(), HasSubstr("'radius_per_size' should be a number")) << bad;
  }
  header_["__metadata__"]["radius_per_size"] = "9";
  for (const char* bad : {"", "log", "Linear"}) {
    header_["__metadata__"]["radial_spacing"] = bad;
    EXPECT_THAT(LoadFault(), HasSubstr("'radial_spacing' should be 'linear' or 'logarithmic'"))
        << bad;
  }
  header_["__metadata__"].erase("radial_spacing");
  header_["__metadata__"].erase("radius_per_size");
  EXPECT_THAT(LoadFault(), HasSubstr("'radius_per_size' is missing"));
  header_["__metadata__"]["format"] = "resnet";
  EXPECT_THAT(LoadFault(), HasSubstr("'format' should be 'pliant-deal'"));
}

}  // namespace
}  // namespace pliant::deal
