// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Accuracy against the committed baseline: fails when a descriptor matches worse than it did, and
// when weights, model card and baseline do not belong together. After a change that is meant:
//   cmake --build --preset release --target accuracy-baseline
#include <cstdio>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "descriptor/image/image.h"
#include "tests/accuracy/small_set.h"
#include "tests/unit/index_test_images.h"

namespace pliant {
namespace {

using evaluation::DescriptorResult;
using nlohmann::json;

constexpr const char* kRegenerate =
    "If the change is meant: cmake --build --preset release --target accuracy-baseline";

std::string ReadText(const std::filesystem::path& path) {
  const std::vector<std::uint8_t> bytes = testing::ReadBytes(path);
  return {bytes.begin(), bytes.end()};
}

const json& Baseline() {
  static const json baseline = json::parse(ReadText(testing::BaselinePath()));
  return baseline;
}

TEST(Accuracy, WeightsModelCardAndBaselineBelongTogether) {
  const std::string card = ReadText(testing::ModelFolder() / "README.md");
  for (const auto& [name, sha256] : testing::WeightHashes()) {
    EXPECT_THAT(card, ::testing::HasSubstr(sha256))
        << "descriptor/model/README.md describes other weights than " << name << ".safetensors";
  }
  EXPECT_EQ(Baseline()["weights"], json(testing::WeightHashes())) << kRegenerate;
}

TEST(Accuracy, NoDescriptorMatchesWorseThanItDid) {
  const evaluation::MatchingReport report = testing::MeasureSmallSet();
  const json& margins = Baseline()["margins"];
  std::printf("%-14s %22s %22s %22s\n", "", "MS", "MMA", "mutual precision");
  ASSERT_EQ(Baseline()["results"].size(), report.results.size()) << kRegenerate;
  EXPECT_EQ(Baseline()["pairs"], report.pairs);
  for (const DescriptorResult& now : report.results) {
    ASSERT_TRUE(Baseline()["results"].contains(now.label)) << now.label << ". " << kRegenerate;
    const json& before = Baseline()["results"][now.label];
    std::printf("%-14s", now.label.c_str());
    for (const auto& [figure, value] : {std::pair{"ms", now.ms}, std::pair{"mma", now.mma},
                                        std::pair{"mutual_precision", now.mutual_precision}}) {
      const double was = before[figure];
      std::printf(" %.3f was %.3f, %+.3f", value, was, value - was);
      EXPECT_GE(value, was - margins[figure].get<double>())
          << now.label << " " << figure << ". " << kRegenerate;
    }
    std::printf("\n");
  }
}

}  // namespace
}  // namespace pliant
