// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How KMedoids runs: threads, stopping, progress, limits, what it refuses.
#include <algorithm>
#include <limits>
#include <stop_token>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/unit/expect_error.h"
#include "tests/unit/random_descriptors.h"
#include "vocab/k_medoids.h"

namespace pliant::testing {
namespace {

TEST(KMedoids, SameForAnyNumberOfThreads) {
  for (const auto& samples : {RandomFloats(1500, 16, 31), RandomBits(1500, 16, 32)}) {
    for (const int k : {1, 3, 60}) {
      KMedoidsOptions options;
      options.k = k;
      options.threads = 1;
      const auto one = KMedoids(samples, options);
      for (const int threads : {2, 3}) {
        auto other_options = options;
        other_options.threads = threads;
        const auto other = KMedoids(samples, other_options);
        EXPECT_EQ(one.medoids, other.medoids);
        EXPECT_EQ(one.assignment, other.assignment);
        EXPECT_EQ(one.loss, other.loss);
        EXPECT_EQ(one.swaps, other.swaps);
        EXPECT_EQ(one.passes, other.passes);
      }
      auto reseeded = options;
      reseeded.seed = 2;
      if (k == 60) {
        EXPECT_NE(KMedoids(samples, reseeded).medoids, one.medoids);
      }
    }
  }
}

TEST(KMedoids, StopsWhenAsked) {
  const auto samples = RandomFloats(2000, 16, 1);
  for (const double at : {0.0, 0.1, 0.17, 0.5}) {
    std::stop_source source;
    KMedoidsOptions options;
    options.k = 200;
    options.stop = source.get_token();
    options.progress = [&](double done, double) {
      if (done >= at) source.request_stop();
    };
    SCOPED_TRACE("to be stopped at " + std::to_string(at));
    ExpectError(ErrorCode::kCancelled, "", [&] { KMedoids(samples, options); });
  }
}

TEST(KMedoids, ProgressOnlyGrows) {
  std::vector<double> done;
  std::vector<double> losses;
  KMedoidsOptions options;
  options.k = 100;
  options.progress = [&](double share, double loss) {
    done.push_back(share);
    if (loss > 0) losses.push_back(loss);
  };
  const auto result = KMedoids(RandomFloats(2000, 8, 1), options);
  EXPECT_GT(done.size(), 10U);
  EXPECT_TRUE(std::is_sorted(done.begin(), done.end()));
  EXPECT_EQ(done.back(), 1.0);
  EXPECT_GE(done.front(), 0.0);
  EXPECT_TRUE(std::is_sorted(losses.rbegin(), losses.rend()));
  EXPECT_EQ(losses.back(), result.loss);
}

TEST(KMedoids, PassLimit) {
  const auto samples = RandomFloats(1000, 8, 1);
  KMedoidsOptions options;
  options.k = 50;
  options.max_passes = 1;
  const auto result = KMedoids(samples, options);
  EXPECT_EQ(result.passes, 1);
  EXPECT_FALSE(result.converged);
  options.max_passes = 0;
  EXPECT_LT(KMedoids(samples, options).loss, result.loss);
}

void ExpectRefused(const Descriptors& samples, int k, const char* reason) {
  KMedoidsOptions options;
  options.k = k;
  ExpectError(ErrorCode::kInvalidArgument, reason, [&] { KMedoids(samples, options); });
}

TEST(KMedoids, RefusesBadInput) {
  const auto good = RandomFloats(10, 4, 1);
  ExpectRefused(good, 0, "bad_k");
  ExpectRefused(good, -1, "bad_k");
  ExpectRefused(good, 11, "bad_k");
  ExpectRefused(Descriptors::Float(0, 4), 1, "bad_k");
  ExpectRefused(Descriptors::Float(kMaxKMedoidsSamples + 1, 1), 2, "too_many_samples");
  auto bad = good;
  bad.floats[7] = std::numeric_limits<float>::quiet_NaN();
  ExpectRefused(bad, 2, "descriptors_not_finite");
  for (float& x : bad.floats) x = 1e30F;
  bad.floats[0] = -1e30F;
  ExpectRefused(bad, 2, "descriptors_out_of_range");
  bad.rows = 11;
  ExpectRefused(bad, 2, "descriptors_malformed");
}

}  // namespace
}  // namespace pliant::testing
