// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/parallel.h"

#include <atomic>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace pliant {
namespace {

TEST(Parallel, EachOnce) {
  for (const int threads : {0, 1, 2, 7}) {
    for (const std::size_t n : {0U, 1U, 5U, 1000U}) {
      std::vector<std::atomic<int>> calls(n);
      ParallelFor(n, threads, [&](std::size_t i) { ++calls[i]; });
      for (const auto& c : calls) EXPECT_EQ(c, 1);
    }
  }
}

TEST(Parallel, TheFirstExceptionComesOut) {
  for (const int threads : {1, 4}) {
    std::atomic<int> calls = 0;
    try {
      ParallelFor(10'000, threads, [&](std::size_t i) {
        ++calls;
        if (i >= 3) throw std::runtime_error(std::to_string(i));
      });
      ADD_FAILURE() << "nothing thrown";
    } catch (const std::runtime_error& e) {
      EXPECT_STREQ(e.what(), "3");
    }
    EXPECT_LT(calls, 10'000);
  }
}

TEST(Parallel, NoTwoBodiesShareAWorker) {
  for (const int threads : {1, 2, 7}) {
    constexpr std::size_t kBodies = 1000;
    const std::size_t workers = ParallelWorkers(kBodies, threads);
    EXPECT_EQ(workers, static_cast<std::size_t>(threads));
    std::vector<std::atomic<int>> busy(workers);
    std::vector<std::size_t> done(workers);  // not atomic: TSan would say so if two shared one
    std::atomic<bool> shared = false;
    ParallelForWorkers(kBodies, threads, [&](std::size_t, std::size_t worker) {
      if (++busy.at(worker) != 1) shared = true;
      ++done.at(worker);
      --busy.at(worker);
    });
    EXPECT_FALSE(shared);
    EXPECT_EQ(std::accumulate(done.begin(), done.end(), std::size_t{0}), kBodies);
  }
  EXPECT_EQ(ParallelWorkers(0, 4), 0U);
  EXPECT_EQ(ParallelWorkers(2, 4), 2U);
}

TEST(Parallel, ResolvesThreads) {
  EXPECT_GE(ResolveThreads(0), 1);
  EXPECT_EQ(ResolveThreads(3), 3);
}

}  // namespace
}  // namespace pliant
