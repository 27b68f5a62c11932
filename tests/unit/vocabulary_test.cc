// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/vocabulary.h"

#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "tests/unit/random_descriptors.h"
#include "vocab/quantizer.h"

namespace pliant {
namespace {

using testing::RandomBits;
using testing::RandomFloats;

KMedoidsOptions Words(int k) {
  KMedoidsOptions options;
  options.k = k;
  options.seed = 5;
  return options;
}

TEST(Vocabulary, WordsAreSamplesAndTheOriginIsKept) {
  const auto samples = RandomFloats(500, 16, 1);
  const auto vocabulary = TrainVocabulary(samples, "sift:1", 90'000, Words(20));
  ASSERT_EQ(vocabulary.size(), 20U);
  EXPECT_EQ(vocabulary.words.dim, 16);
  EXPECT_EQ(vocabulary.model_id, "sift:1");
  EXPECT_EQ(vocabulary.origin.seed, 5U);
  EXPECT_EQ(vocabulary.origin.sampled, 500U);
  EXPECT_EQ(vocabulary.origin.available, 90'000U);
  EXPECT_EQ(vocabulary.origin.method, "fasterpam");
  const auto result = KMedoids(samples, Words(20));
  EXPECT_DOUBLE_EQ(vocabulary.origin.loss, result.loss / 500);
  // Assigning the samples gives back the clusters.
  const Quantizer quantizer(std::make_shared<Vocabulary>(vocabulary));
  EXPECT_EQ(quantizer.Assign(samples), result.assignment);
}

TEST(Vocabulary, FewDifferentSamplesGiveFewerWords) {
  const auto kinds = RandomBits(6, 8, 1);
  auto samples = Descriptors::Binary(90, 8);
  for (std::size_t i = 0; i < samples.bytes.size(); ++i) {
    samples.bytes[i] = kinds.bytes[i % kinds.bytes.size()];
  }
  for (const int k : {6, 7, 90, 1000}) {
    const auto vocabulary = TrainVocabulary(samples, "orb:1", 0, Words(k));
    EXPECT_EQ(vocabulary.size(), 6U) << "k = " << k;
    EXPECT_EQ(vocabulary.origin.loss, 0);
    EXPECT_EQ(vocabulary.origin.available, 90U);
    // Every word is in use.
    const auto words = Quantizer(std::make_shared<Vocabulary>(vocabulary)).Assign(samples);
    EXPECT_EQ(std::set(words.begin(), words.end()).size(), 6U);
  }
  EXPECT_EQ(TrainVocabulary(samples, "orb:1", 0, Words(3)).size(), 3U);
}

TEST(Vocabulary, EveryWordIsInUseAmongManyDuplicates) {
  // Half of the samples are one and the same descriptor, as flat regions of images give.
  auto samples = RandomFloats(400, 8, 3);
  std::fill(samples.floats.begin(), samples.floats.begin() + 200 * 8, 0.25F);
  for (const int max_passes : {0, 1}) {
    auto options = Words(150);
    options.max_passes = max_passes;
    const auto vocabulary = TrainVocabulary(samples, "sift:1", 400, options);
    if (max_passes == 0) {
      EXPECT_EQ(vocabulary.size(), 150U);
    }
    const auto words = Quantizer(std::make_shared<Vocabulary>(vocabulary)).Assign(samples);
    EXPECT_EQ(std::set(words.begin(), words.end()).size(), vocabulary.size());
  }
}

TEST(Vocabulary, RefusesNothingToTrainFrom) {
  for (const auto& [samples, k, reason] : {std::tuple(Descriptors::Float(0, 8), 10, "no_samples"),
                                           std::tuple(RandomFloats(9, 8, 1), 0, "bad_k"),
                                           std::tuple(RandomFloats(9, 8, 1), -3, "bad_k")}) {
    try {
      TrainVocabulary(samples, "sift:1", 0, Words(k));
      ADD_FAILURE() << "accepted; expected " << reason;
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kInvalidArgument);
      EXPECT_EQ(e.reason(), reason);
    }
  }
}

}  // namespace
}  // namespace pliant
