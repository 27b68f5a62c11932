// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/signature.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "descriptor/match/distance.h"
#include "tests/unit/random_descriptors.h"
#include "vocab/quantizer.h"

namespace pliant {
namespace {

using testing::RandomBits;
using testing::RandomFloats;

TEST(Signature, ProjectionOfFloatsIsARotationOrAPartOfOne) {
  // The directions are orthogonal: projecting the axes gives columns with unit rows.
  auto axes = Descriptors::Float(128, 128);
  for (std::size_t i = 0; i < 128; ++i) axes.floats[i * 128 + i] = 1;
  const SignatureProjection project(DescriptorKind::kFloat, 128);
  std::vector<std::array<float, kSignatureBits>> rows;
  for (std::size_t i = 0; i < 128; ++i) rows.push_back(project(axes, i));
  for (int a = 0; a < kSignatureBits; ++a) {
    for (int b = 0; b <= a; ++b) {
      double dot = 0;
      for (const auto& row : rows) dot += static_cast<double>(row[a]) * row[b];
      EXPECT_NEAR(dot, a == b ? 1 : 0, 1e-5);
    }
  }
}

TEST(Signature, SmallDescriptorsHaveSignaturesToo) {
  for (const int dim : {1, 3, 63}) {
    const auto floats = RandomFloats(2, dim, 1);
    for (const float value : SignatureProjection(DescriptorKind::kFloat, dim)(floats, 0)) {
      EXPECT_TRUE(std::isfinite(value));
    }
    const auto bits = RandomBits(2, dim, 1);
    for (const float value : SignatureProjection(DescriptorKind::kBinary, dim)(bits, 1)) {
      EXPECT_TRUE(value == 0 || value == 1);
    }
  }
}

TEST(Signature, ThresholdsAreMeansOfTheSamplesAndTheWord) {
  const auto samples = RandomFloats(60, 16, 2);
  const auto words = SelectRows(samples, std::vector<std::uint32_t>{3, 9});
  std::vector<std::uint32_t> assignment;
  for (std::uint32_t i = 0; i < 60; ++i) assignment.push_back(i % 2);
  const auto thresholds = LearnThresholds(samples, assignment, words);
  const SignatureProjection project(DescriptorKind::kFloat, 16);
  ASSERT_EQ(thresholds.size(), 2U * kSignatureBits);
  for (std::size_t w = 0; w < 2; ++w) {
    for (std::size_t b = 0; b < kSignatureBits; ++b) {
      double sum = project(words, w)[b];
      for (std::size_t i = w; i < 60; i += 2) sum += project(samples, i)[b];
      EXPECT_NEAR(thresholds[w * kSignatureBits + b], sum / 31, 1e-5);
    }
  }
}

class SignatureKinds : public ::testing::TestWithParam<bool> {};

TEST_P(SignatureKinds, NearDescriptorsDifferInFewBitsAndOthersInHalf) {
  const bool binary = GetParam();
  constexpr std::size_t kRows = 200;
  const auto samples = binary ? RandomBits(kRows, 32, 5) : RandomFloats(kRows, 64, 5);
  auto near = samples;
  std::mt19937_64 random(6);
  std::normal_distribution<float> noise(0, 0.2F);
  for (float& x : near.floats) x += noise(random);
  for (std::size_t i = 0; i < near.bytes.size(); i += 8) near.bytes[i] ^= 1;  // 4 of 256 bits
  auto vocabulary = std::make_shared<Vocabulary>();
  vocabulary->words = SelectRows(samples, std::vector<std::uint32_t>{0});
  vocabulary->thresholds =
      LearnThresholds(samples, std::vector<std::uint32_t>(kRows, 0), vocabulary->words);
  const Quantizer quantizer(vocabulary);
  const std::vector<std::uint32_t> word = {0};
  double near_bits = 0;
  double other_bits = 0;
  for (std::size_t i = 0; i < kRows; ++i) {
    const auto signature = quantizer.BowOf(samples, i, word).signatures.at(0);
    near_bits += std::popcount(signature ^ quantizer.BowOf(near, i, word).signatures.at(0));
    other_bits +=
        std::popcount(signature ^ quantizer.BowOf(samples, (i + 1) % kRows, word).signatures.at(0));
  }
  EXPECT_LT(near_bits / kRows, 6);
  EXPECT_NEAR(other_bits / kRows, 32, 2);
}

INSTANTIATE_TEST_SUITE_P(Kinds, SignatureKinds, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "binary" : "floats"; });

TEST(Signature, OneAWordAndTheResidualsOfAWordAddUp) {
  const auto samples = RandomFloats(40, 32, 8);
  KMedoidsOptions options;
  options.k = 6;
  const Vocabulary trained = TrainVocabulary(samples, "test:1", 40, options);
  const auto vocabulary = std::make_shared<const Vocabulary>(trained);
  const Quantizer quantizer(vocabulary);
  ASSERT_TRUE(quantizer.has_signatures());
  const auto words = quantizer.Assign(samples);
  const Bow bow = quantizer.BowOf(samples, 10, std::span(words).subspan(10, 25));
  EXPECT_EQ(bow.total, 25U);
  EXPECT_EQ(bow.words, MakeBow({words.begin() + 10, words.begin() + 35}).words);
  ASSERT_EQ(bow.signatures.size(), bow.words.size());
  const SignatureProjection project(DescriptorKind::kFloat, 32);
  for (std::size_t e = 0; e < bow.words.size(); ++e) {
    const std::uint32_t word = bow.words[e].word;
    for (int b = 0; b < kSignatureBits; ++b) {
      double sum = 0;
      for (std::size_t i = 10; i < 35; ++i) {
        if (words[i] != word) continue;
        sum += project(samples, i)[b] - trained.thresholds[word * kSignatureBits + b];
      }
      if (std::abs(sum) < 1e-4) continue;  // rounding may decide
      EXPECT_EQ(bow.signatures[e] >> b & 1, sum > 0 ? 1U : 0U);
    }
  }
}

TEST(Signature, SeveralWordsARowAreTheNearestInOrder) {
  const auto samples = RandomFloats(50, 8, 4);
  KMedoidsOptions options;
  options.k = 9;
  const auto vocabulary =
      std::make_shared<const Vocabulary>(TrainVocabulary(samples, "test:1", 50, options));
  const Quantizer quantizer(vocabulary);
  for (const int count : {1, 3, 20}) {
    const auto several = quantizer.AssignSeveral(samples, count, 2);
    const std::size_t kept = std::min<std::size_t>(static_cast<std::size_t>(count), 9);
    ASSERT_EQ(several.size(), 50 * kept);
    for (std::size_t i = 0; i < 50; ++i) {
      std::vector<std::pair<double, std::uint32_t>> order;
      for (std::uint32_t w = 0; w < 9; ++w) {
        order.emplace_back(testing::PlainDistance(samples, i, vocabulary->words, w), w);
      }
      std::sort(order.begin(), order.end());
      for (std::size_t j = 0; j < kept; ++j) EXPECT_EQ(several[i * kept + j], order[j].second);
    }
  }
  EXPECT_EQ(quantizer.AssignSeveral(samples, 1), quantizer.Assign(samples));
  EXPECT_EQ(quantizer.BowOf(samples, 0, quantizer.AssignSeveral(samples, 3), 3).total, 150U);
}

}  // namespace
}  // namespace pliant
