// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/k_medoids.h"

#include <algorithm>
#include <limits>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/error.h"
#include "tests/unit/random_descriptors.h"

namespace pliant {
namespace {

using testing::PlainDistance;
using testing::RandomBits;
using testing::RandomFloats;
using testing::RandomGrid;

double Loss(const Descriptors& samples, const std::vector<std::uint32_t>& medoids) {
  double loss = 0;
  for (std::size_t o = 0; o < samples.rows; ++o) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto m : medoids) nearest = std::min(nearest, PlainDistance(samples, o, samples, m));
    loss += nearest;
  }
  return loss;
}

// The most that one exchange of a medoid could lower the loss by, tried one by one.
double BestSwap(const Descriptors& samples, const std::vector<std::uint32_t>& medoids) {
  const double loss = Loss(samples, medoids);
  double best = 0;
  for (std::size_t i = 0; i < medoids.size(); ++i) {
    for (std::uint32_t c = 0; c < samples.rows; ++c) {
      if (std::count(medoids.begin(), medoids.end(), c) != 0) continue;
      auto swapped = medoids;
      swapped[i] = c;
      best = std::max(best, loss - Loss(samples, swapped));
    }
  }
  return best;
}

// BUILD of the original PAM (Kaufman and Rousseeuw), then the best swap until there is none.
double BruteForcePam(const Descriptors& samples, int k) {
  std::vector<std::uint32_t> medoids;
  const auto improve = [&](auto&& make) {
    double best = std::numeric_limits<double>::infinity();
    std::vector<std::uint32_t> chosen = medoids;
    for (std::uint32_t c = 0; c < samples.rows; ++c) {
      if (std::count(medoids.begin(), medoids.end(), c) != 0) continue;
      make(c, &best, &chosen);
    }
    medoids = chosen;
    return best;
  };
  const auto keep = [&](const std::vector<std::uint32_t>& tried, double* best,
                        std::vector<std::uint32_t>* chosen) {
    const double loss = Loss(samples, tried);
    if (loss < *best) {
      *best = loss;
      *chosen = tried;
    }
  };
  double loss = 0;
  for (int i = 0; i < k; ++i) {
    loss = improve([&](std::uint32_t c, double* best, auto* chosen) {
      auto tried = medoids;
      tried.push_back(c);
      keep(tried, best, chosen);
    });
  }
  for (;;) {
    const auto before = medoids;
    const double next = improve([&](std::uint32_t c, double* best, auto* chosen) {
      for (int i = 0; i < k; ++i) {
        auto tried = before;
        tried[i] = c;
        keep(tried, best, chosen);
      }
    });
    if (next >= loss - 1e-9) return loss;
    loss = next;
  }
}

void ExpectSound(const Descriptors& samples, const KMedoidsOptions& options,
                 const KMedoidsResult& result) {
  ASSERT_EQ(result.medoids.size(), static_cast<std::size_t>(options.k));
  EXPECT_TRUE(std::is_sorted(result.medoids.begin(), result.medoids.end()));
  EXPECT_EQ(std::set(result.medoids.begin(), result.medoids.end()).size(), result.medoids.size());
  EXPECT_LT(result.medoids.back(), samples.rows);
  ASSERT_EQ(result.assignment.size(), samples.rows);
  for (std::size_t o = 0; o < samples.rows; ++o) {
    const double mine = PlainDistance(samples, o, samples, result.medoids[result.assignment[o]]);
    for (const auto m : result.medoids) {
      ASSERT_LE(mine, PlainDistance(samples, o, samples, m) + 1e-5) << "sample " << o;
    }
  }
  const double loss = Loss(samples, result.medoids);
  EXPECT_NEAR(result.loss, loss, 1e-5 * loss + 1e-9);
  if (!result.converged) return;
  EXPECT_LE(BestSwap(samples, result.medoids), 1e-5 * loss + 1e-9);
}

struct Case {
  const char* name;
  std::size_t rows;
  int k;
};

class KMedoidsCases : public ::testing::TestWithParam<Case> {};

TEST_P(KMedoidsCases, EndsWhereNoSwapImproves) {
  const auto [name, rows, k] = GetParam();
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    for (const auto& samples :
         {RandomFloats(rows, 5, seed), RandomGrid(rows, 2, 4, seed), RandomBits(rows, 3, seed)}) {
      KMedoidsOptions options;
      options.k = k;
      options.seed = seed;
      const auto result = KMedoids(samples, options);
      EXPECT_TRUE(result.converged);
      ExpectSound(samples, options, result);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Small, KMedoidsCases,
                         ::testing::Values(Case{"one", 1, 1}, Case{"two", 2, 2},
                                           Case{"centre", 40, 1}, Case{"pair", 40, 2},
                                           Case{"some", 61, 7}, Case{"many", 50, 25},
                                           Case{"nearly_all", 33, 32}, Case{"all", 33, 33}),
                         [](const auto& test) { return std::string(test.param.name); });

// Local optima differ; over some seeds the best must be at least as good as PAM's one answer, and
// the mean not far off.
TEST(KMedoids, AsGoodAsBruteForcePam) {
  for (const auto& samples : {RandomFloats(60, 4, 21), RandomBits(60, 4, 22)}) {
    for (const int k : {2, 5, 9}) {
      const double pam = BruteForcePam(samples, k);
      double best = std::numeric_limits<double>::infinity();
      double sum = 0;
      constexpr int kSeeds = 10;
      for (int seed = 1; seed <= kSeeds; ++seed) {
        KMedoidsOptions options;
        options.k = k;
        options.seed = static_cast<std::uint64_t>(seed);
        const double loss = KMedoids(samples, options).loss;
        best = std::min(best, loss);
        sum += loss;
      }
      EXPECT_LE(best, pam * (1 + 1e-6)) << "k = " << k;
      EXPECT_LE(sum / kSeeds, pam * 1.03) << "k = " << k;
    }
  }
}

TEST(KMedoids, FindsPlantedClusters) {
  auto samples = RandomFloats(600, 8, 5);
  for (std::size_t i = 0; i < samples.rows; ++i) {
    samples.floats[i * 8 + i % 6] += 100;
  }
  KMedoidsOptions options;
  options.k = 6;
  const auto result = KMedoids(samples, options);
  for (std::size_t i = 6; i < samples.rows; ++i) {
    ASSERT_EQ(result.assignment[i], result.assignment[i % 6]) << i;
  }
}

TEST(KMedoids, SameForAnyNumberOfThreadsAndAnyMemory) {
  for (const auto& samples : {RandomFloats(1500, 16, 31), RandomBits(1500, 16, 32)}) {
    for (const int k : {1, 3, 60}) {
      KMedoidsOptions options;
      options.k = k;
      options.threads = 1;
      const auto one = KMedoids(samples, options);
      for (const int threads : {2, 3}) {
        for (const std::uint64_t bytes : {options.max_matrix_bytes, std::uint64_t{0}}) {
          auto other_options = options;
          other_options.threads = threads;
          other_options.max_matrix_bytes = bytes;
          const auto other = KMedoids(samples, other_options);
          EXPECT_EQ(one.medoids, other.medoids);
          EXPECT_EQ(one.assignment, other.assignment);
          EXPECT_EQ(one.loss, other.loss);
          EXPECT_EQ(one.swaps, other.swaps);
          EXPECT_EQ(one.passes, other.passes);
        }
      }
      auto reseeded = options;
      reseeded.seed = 2;
      if (k == 60) {
        EXPECT_NE(KMedoids(samples, reseeded).medoids, one.medoids);
      }
    }
  }
}

TEST(KMedoids, IdenticalAndDuplicatedSamples) {
  auto same = Descriptors::Float(50, 3);
  std::fill(same.floats.begin(), same.floats.end(), 0.3F);
  KMedoidsOptions options;
  options.k = 7;
  auto result = KMedoids(same, options);
  EXPECT_EQ(result.loss, 0);
  EXPECT_TRUE(result.converged);
  ExpectSound(same, options, result);

  // 5 different rows, 20 times each.
  auto five = RandomFloats(5, 3, 1);
  auto copies = Descriptors::Float(100, 3);
  for (std::size_t i = 0; i < copies.floats.size(); ++i) {
    copies.floats[i] = five.floats[i % five.floats.size()];
  }
  options.k = 5;
  result = KMedoids(copies, options);
  EXPECT_EQ(result.loss, 0);
  std::set<std::uint32_t> kinds;
  for (const auto m : result.medoids) kinds.insert(m % 5);
  EXPECT_EQ(kinds.size(), 5U);
  options.k = 9;
  EXPECT_EQ(KMedoids(copies, options).loss, 0);
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
    try {
      KMedoids(samples, options);
      ADD_FAILURE() << "not stopped at " << at;
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ErrorCode::kCancelled);
    }
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
  try {
    KMedoids(samples, options);
    ADD_FAILURE() << "accepted; expected " << reason;
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::kInvalidArgument);
    EXPECT_EQ(e.reason(), reason);
  }
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
}  // namespace pliant
