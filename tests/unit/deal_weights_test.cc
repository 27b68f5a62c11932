// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The weight file's reader: sound files are read, everything else is refused by name.
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
#include "descriptor/deal/safetensors.h"
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

// Two tensors: a of 2 x 3 floats, b of 2 floats; 32 bytes of data.
const char* const kSound = R"({"__metadata__": {"format": "x"},
  "a": {"dtype": "F32", "shape": [2, 3], "data_offsets": [0, 24]},
  "b": {"dtype": "F32", "shape": [2], "data_offsets": [24, 32]}})";

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

std::string ParseFault(const std::string& header, std::size_t data_bytes = 32) {
  return Fault([&] {
    SafetensorsFile::Parse(FileOf(header, std::vector<std::uint8_t>(data_bytes)), "w.safetensors");
  });
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(SafetensorsTest, ReadsSoundFile) {
  std::vector<std::uint8_t> data(32);
  const float values[] = {1, 2, 3, 4, 5, 6, 7, 8};
  std::memcpy(data.data(), values, 32);
  const SafetensorsFile file = SafetensorsFile::Parse(FileOf(kSound, data), "w");
  EXPECT_EQ(file.Floats("a"), (std::vector<float>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(file.Floats("b"), (std::vector<float>{7, 8}));
  EXPECT_EQ(file.tensors().at("a").shape, (std::vector<std::int64_t>{2, 3}));
  EXPECT_EQ(file.metadata().at("format"), "x");
}

TEST(SafetensorsTest, RefusesMalformedHeadersByName) {
  struct Case {
    const char* from;
    const char* to;
    const char* expected;
  };
  const Case cases[] = {
      {"[24, 32]", "[24, 36]", "'b' ends at byte 36 of 32"},
      {"[24, 32]", "[20, 28]", "'b' overlaps"},
      {"[24, 32]", "[28, 32]", "'b' holds 4 bytes, but its shape [2] needs 8"},
      {"[24, 32]", "[32, 24]", "'b' has data_offsets"},
      {"[24, 32]", "[-8, 0]", "'b' has data_offsets"},
      {"[24, 32]", "[24.0, 32]", "'b' has data_offsets"},
      {"[24, 32]", "[24, 18446744073709551615]", "'b' has data_offsets"},
      {"[24, 32]", "24", "'b' has data_offsets"},
      {"[2, 3]", "[2, -3]", "'a' has an extent"},
      {"[2, 3]", "[4294967296, 4294967296]", "'a' has a shape larger"},
      {"[2, 3]", "[0, 9223372036854775807, 4]", "'a' holds 24 bytes"},
      {"[2, 3]", "\"6\"", "'a' has a shape that is not"},
      {"\"F32\"", "\"F33\"", "'a' has the unknown dtype 'F33'"},
      {"\"F32\"", "7", "'a' has a dtype"},
      {"\"shape\": [2, 3], ", "", "'a' needs dtype, shape"},
      {"\"b\"", "\"a\"", "'a' is described twice"},
      {"\"x\"", "1", "__metadata__ 'format'"},
      {"{\"format\": \"x\"}", "[]", "__metadata__ is not"},
  };
  for (const Case& c : cases) {
    const std::string fault = ParseFault(Replaced(kSound, c.from, c.to));
    EXPECT_THAT(fault, HasSubstr(c.expected)) << c.from << " -> " << c.to;
    EXPECT_THAT(fault, HasSubstr("w.safetensors"));
  }
  EXPECT_THAT(ParseFault("[]"), HasSubstr("not a JSON object"));
  EXPECT_THAT(ParseFault("{"), HasSubstr("not a JSON object"));
  EXPECT_THAT(ParseFault(kSound, 33), HasSubstr("1 bytes after the last tensor"));
  EXPECT_THAT(ParseFault(std::string(100000, '[')), HasSubstr("not a JSON object"));
}

TEST(SafetensorsTest, RefusesEveryTruncation) {
  const std::vector<std::uint8_t> whole = FileOf(kSound, std::vector<std::uint8_t>(32));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::vector<std::uint8_t> part(whole.begin(), whole.begin() + static_cast<long>(size));
    EXPECT_NE(Fault([&] { SafetensorsFile::Parse(part, "w"); }), "(nothing thrown)") << size;
  }
}

TEST(SafetensorsTest, RefusesHugeHeaderLengthAndMissingFile) {
  std::vector<std::uint8_t> bytes(100, 0xff);
  EXPECT_THAT(Fault([&] { SafetensorsFile::Parse(bytes, "w"); }), HasSubstr("exceeds the file"));
  try {
    SafetensorsFile::Open("/nonexistent/w.safetensors");
    FAIL() << "opened a file that does not exist";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kNotFound);
    EXPECT_THAT(error.what(), HasSubstr("/nonexistent/w.safetensors"));
  }
}

TEST(SafetensorsTest, RandomDamageIsRefusedOrReadWithinTheFile) {
  constexpr std::uint32_t kSeed = 20211206;
  std::mt19937 random(kSeed);
  const std::vector<std::uint8_t> whole = FileOf(kSound, std::vector<std::uint8_t>(32));
  int refused = 0;
  for (int round = 0; round < 3000; ++round) {
    std::vector<std::uint8_t> bytes = whole;
    for (std::uint32_t n = random() % 4 + 1; n > 0; --n) {
      bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    }
    if (random() % 8 == 0) bytes.resize(random() % bytes.size());
    try {
      const SafetensorsFile file = SafetensorsFile::Parse(bytes, "w");
      for (const auto& [name, info] : file.tensors()) {
        if (info.dtype == "F32") {
          EXPECT_LE(file.Floats(name).size(), 8U) << "seed " << kSeed;
        }
      }
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << "seed " << kSeed << ": " << error.what();
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000) << "seed " << kSeed;
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
    data_.assign(shipped.bytes().begin() + 8 + static_cast<long>(length), shipped.bytes().end());
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
  EXPECT_EQ(weights.localization.front().inputs, kSampledValues);
  EXPECT_EQ(weights.localization.back().outputs, kThetaValues);
  EXPECT_GT(weights.radius_per_size, 0);
  EXPECT_EQ(weights.sha256.size(), 64U);
}

TEST_F(DealWeightsTest, NamesMissingAndUnknownTensors) {
  Rename("hardnet.conv6.weight", "hardnet.conv7.weight");
  EXPECT_THAT(LoadFault(), HasSubstr("'hardnet.conv6.weight' is missing"));
  Rename("hardnet.conv7.weight", "hardnet.conv6.weight");
  EXPECT_EQ(LoadFault(), "(nothing thrown)");
  header_["extra"] = {{"dtype", "F32"}, {"shape", {0}}, {"data_offsets", {0, 0}}};
  EXPECT_THAT(LoadFault(), HasSubstr("'extra' is unknown"));
}

TEST_F(DealWeightsTest, NamesWrongShapes) {
  header_["hardnet.conv1.weight"]["shape"] = {32, 9};
  EXPECT_THAT(LoadFault(), HasSubstr("'hardnet.conv1.weight' should have shape [32, 1, 3, 3]"));
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
  header_["__metadata__"].erase("radius_per_size");
  EXPECT_THAT(LoadFault(), HasSubstr("'radius_per_size' is missing"));
  header_["__metadata__"]["format"] = "resnet";
  EXPECT_THAT(LoadFault(), HasSubstr("'format' should be 'pliant-deal'"));
}

}  // namespace
}  // namespace pliant::deal
