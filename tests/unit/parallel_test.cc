// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/parallel.h"

#include <atomic>
#include <mutex>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

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

TEST(Parallel, LoopsShareTheirThreads) {
  std::mutex mutex;
  std::set<std::thread::id> seen;
  for (int round = 0; round < 200; ++round) {
    ParallelFor(64, 4, [&](std::size_t) {
      const std::lock_guard lock(mutex);
      seen.insert(std::this_thread::get_id());
    });
  }
  // Fresh threads in every loop would be 600. Loops of the tests above may have left a few more.
  EXPECT_LE(seen.size(), 16U);
}

TEST(Parallel, EveryThreadThatIsAskedForComes) {
  constexpr std::size_t kThreads = 5;
  std::atomic<std::size_t> inside = 0;
  ParallelFor(kThreads, kThreads, [&](std::size_t) {
    ++inside;
    while (inside < kThreads) std::this_thread::yield();
  });
  EXPECT_EQ(inside, kThreads);
}

TEST(Parallel, NestedLoops) {
  std::atomic<int> calls = 0;
  ParallelFor(8, 4, [&](std::size_t) {
    ParallelFor(8, 3, [&](std::size_t) { ParallelFor(8, 2, [&](std::size_t) { ++calls; }); });
  });
  EXPECT_EQ(calls, 8 * 8 * 8);
}

TEST(Parallel, AnExceptionOfANestedLoopReachesTheCaller) {
  const auto nested = [] {
    ParallelFor(16, 4, [&](std::size_t i) {
      ParallelFor(16, 4, [&](std::size_t k) {
        if (i == 0 && k == 0) throw std::runtime_error("inner");
      });
    });
  };
  EXPECT_THROW(nested(), std::runtime_error);
}

TEST(Parallel, ConcurrentCallers) {
  constexpr int kCallers = 6;
  std::atomic<int> calls = 0;
  std::atomic<int> failures = 0;
  {
    std::vector<std::jthread> callers;
    for (int c = 0; c < kCallers; ++c) {
      callers.emplace_back([&, c] {
        for (int round = 0; round < 100; ++round) {
          try {
            ParallelFor(20, 3, [&](std::size_t i) {
              ++calls;
              if (c == 0 && i == 19) throw std::runtime_error("the last of 20");
            });
          } catch (const std::runtime_error&) {
            ++failures;
          }
        }
      });
    }
  }
  EXPECT_EQ(calls, kCallers * 100 * 20);
  EXPECT_EQ(failures, 100);
}

#ifndef __SANITIZE_THREAD__  // TSan ends the child of a process with threads at its first thread
TEST(Parallel, TheChildOfAForkHasThreadsOfItsOwn) {
  std::atomic<bool> stop = false;
  const std::jthread busy([&] {
    while (!stop) ParallelFor(64, 4, [](std::size_t) {});
  });
  for (int round = 0; round < 20; ++round) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      std::atomic<int> inside = 0;
      ParallelFor(3, 3, [&](std::size_t) {
        ++inside;
        while (inside < 3) std::this_thread::yield();
      });
      ::_exit(inside == 3 ? 0 : 1);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_EQ(status, 0);
  }
  stop = true;
}
#endif

TEST(Parallel, ResolvesThreads) {
  EXPECT_GE(ResolveThreads(0), 1);
  EXPECT_EQ(ResolveThreads(3), 3);
}

}  // namespace
}  // namespace pliant
