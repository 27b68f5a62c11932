// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What KMedoids finds, against trying everything.
#include "vocab/k_medoids.h"

#include <algorithm>
#include <limits>
#include <set>

#include <gtest/gtest.h>

#include "tests/unit/random_descriptors.h"

namespace pliant::testing {
namespace {

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

}  // namespace
}  // namespace pliant::testing
