// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/hierarchical_k_medoids.h"

#include <algorithm>
#include <limits>
#include <set>

#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/random_descriptors.h"
#include "vocab/vocabulary.h"

namespace pliant {
namespace {

using testing::ExpectError;
using testing::PlainDistance;
using testing::RandomBits;
using testing::RandomFloats;

// Descriptors in clusters, as those of images are.
Descriptors Clustered(std::size_t rows, bool binary, std::uint64_t seed) {
  const std::size_t centres = 40;
  const Descriptors middle = binary ? RandomBits(centres, 16, 77) : RandomFloats(centres, 8, 77);
  Descriptors noise = binary ? RandomBits(rows, 16, seed) : RandomFloats(rows, 8, seed);
  for (std::size_t i = 0; i < rows; ++i) {
    const std::size_t c = (i * 7919 + i / 3) % centres;
    for (int d = 0; d < noise.dim; ++d) {
      const std::size_t at = i * static_cast<std::size_t>(noise.dim) + static_cast<std::size_t>(d);
      if (binary) {
        noise.bytes[at] = middle.binary_row(c)[d] ^ (noise.bytes[at] & (noise.bytes[at] >> 3) & 17);
      } else {
        noise.floats[at] = 3 * middle.float_row(c)[d] + noise.floats[at];
      }
    }
  }
  return noise;
}

class HierarchicalKinds : public ::testing::TestWithParam<bool> {};

TEST_P(HierarchicalKinds, IsNearlyAsGoodAsFasterPam) {
  const Descriptors samples = Clustered(2500, GetParam(), 1);
  for (const int k : {2, 60, 300}) {
    KMedoidsOptions options;
    options.k = k;
    options.threads = 2;
    const HierarchicalKMedoidsResult result = HierarchicalKMedoids(samples, options);
    ASSERT_EQ(result.medoids.size(), static_cast<std::size_t>(k));
    EXPECT_TRUE(std::is_sorted(result.medoids.begin(), result.medoids.end()));
    EXPECT_EQ(DistinctRows(samples, result.medoids).size(), result.medoids.size());
    const double exact = KMedoids(samples, options).loss / 2500;
    EXPECT_LT(result.mean_loss, 1.12 * exact) << k;
    EXPECT_GT(result.mean_loss, 0.97 * exact) << k;
  }
}

TEST_P(HierarchicalKinds, TheReportedLossIsThatOfTheNearestMedoids) {
  const Descriptors samples = Clustered(1500, GetParam(), 2);
  KMedoidsOptions options;
  options.k = 50;
  const HierarchicalKMedoidsResult result = HierarchicalKMedoids(samples, options);
  ASSERT_EQ(result.judged.size(), 1500U);  // few enough to look at all
  double loss = 0;
  for (std::size_t i = 0; i < result.judged.size(); ++i) {
    double best = std::numeric_limits<double>::infinity();
    for (const std::uint32_t m : result.medoids) {
      best = std::min(best, PlainDistance(samples, result.judged[i], samples, m));
    }
    EXPECT_NEAR(
        PlainDistance(samples, result.judged[i], samples, result.medoids[result.assignment[i]]),
        best, 1e-3);
    loss += best;
  }
  EXPECT_NEAR(result.mean_loss, loss / 1500, 1e-3);
}

INSTANTIATE_TEST_SUITE_P(Kinds, HierarchicalKinds, ::testing::Bool(),
                         [](const auto& test) { return test.param ? "binary" : "floats"; });

TEST(HierarchicalKMedoids, TheSameSeedGivesTheSameMedoidsWithAnyThreads) {
  const Descriptors samples = Clustered(8300, false, 3);
  KMedoidsOptions options;
  options.k = 100;
  options.threads = 1;
  const auto one = HierarchicalKMedoids(samples, options);
  options.threads = 3;
  EXPECT_EQ(HierarchicalKMedoids(samples, options).medoids, one.medoids);
  options.seed = 2;
  EXPECT_NE(HierarchicalKMedoids(samples, options).medoids, one.medoids);
}

TEST(HierarchicalKMedoids, EqualSamplesNeverMakeEqualMedoids) {
  // 30 different samples, most of them thousands of times.
  Descriptors samples = Descriptors::Float(6000, 4);
  const Descriptors different = RandomFloats(30, 4, 5);
  for (std::size_t i = 0; i < samples.rows; ++i) {
    const std::size_t from = i < 30 ? i : i % 5;
    std::copy_n(different.float_row(from).begin(), 4,
                samples.floats.begin() + static_cast<std::ptrdiff_t>(4 * i));
  }
  KMedoidsOptions options;
  options.k = 30;
  const auto all = HierarchicalKMedoids(samples, options);
  EXPECT_EQ(DistinctRows(samples, all.medoids).size(), 30U);
  EXPECT_NEAR(all.mean_loss, 0, 1e-3);
  options.k = 31;
  ExpectError(ErrorCode::kInvalidArgument, "bad_k",
              [&] { HierarchicalKMedoids(samples, options); });
  options.k = 0;
  ExpectError(ErrorCode::kInvalidArgument, "bad_k",
              [&] { HierarchicalKMedoids(samples, options); });
}

TEST(HierarchicalKMedoids, ReportsProgressAndStops) {
  const Descriptors samples = Clustered(5000, false, 6);
  KMedoidsOptions options;
  options.k = 64;
  double before = 0;
  options.progress = [&](double done, double) {
    EXPECT_GE(done, before);
    EXPECT_LE(done, 1);
    before = done;
  };
  HierarchicalKMedoids(samples, options);
  EXPECT_EQ(before, 1);
  std::stop_source source;
  options.stop = source.get_token();
  options.progress = [&](double done, double) {
    if (done > 0.25) source.request_stop();
  };
  ExpectError(ErrorCode::kCancelled, "cancelled", [&] { HierarchicalKMedoids(samples, options); });
}

TEST(HierarchicalKMedoids, LargeSamplesMakeVocabulariesWithCodebooks) {
  const Descriptors samples = Clustered(kMaxExactSamples + 1, false, 7);
  KMedoidsOptions options;
  options.k = 200;
  const Vocabulary vocabulary = TrainVocabulary(samples, "test:1", 50'000, options);
  EXPECT_EQ(vocabulary.size(), 200U);
  EXPECT_EQ(vocabulary.origin.method, "fasterpam tree");
  EXPECT_EQ(vocabulary.origin.sampled, kMaxExactSamples + 1);
  EXPECT_FALSE(vocabulary.codebook.empty());
  EXPECT_GT(vocabulary.origin.loss, 0);
}

}  // namespace
}  // namespace pliant
