// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Worker pool and the thumbnail cache.
#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <latch>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/http/problem.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {
namespace {

using Lane = WorkerPool::Lane;
using std::chrono::milliseconds;

std::string CodeOf(std::future<void>& future) {
  try {
    future.get();
  } catch (const ProblemError& error) {
    return error.problem().code;
  }
  return "";
}

// Runs `work` on the pool from a thread of its own, as a request would.
std::future<void> Submit(WorkerPool& pool, Lane lane, std::function<void(int)> work) {
  return std::async(std::launch::async, [&pool, lane, work] { pool.Run(lane, work); });
}

void AwaitWaiting(const WorkerPool& pool, std::size_t count) {
  while (pool.load().waiting_searches + pool.load().waiting_uploads < count) {
    std::this_thread::sleep_for(milliseconds(1));
  }
}

TEST(WorkerPool, GivesResultsAndExceptions) {
  WorkerPool pool({.cores = 2});
  int value = 0;
  pool.Run(Lane::kSearch, [&](int cores) { value = cores; });
  EXPECT_EQ(value, 2) << "a task alone gets all cores";
  EXPECT_THROW(pool.Run(Lane::kUpload, [](int) { throw std::runtime_error("x"); }),
               std::runtime_error);
  pool.Run(Lane::kUpload, [&](int) { value = 7; });
  EXPECT_EQ(value, 7);
}

TEST(WorkerPool, NeverUsesMoreCoresThanItHas) {
  constexpr int kCores = 4;
  WorkerPool pool({.cores = kCores, .queue_length = 1000});
  std::atomic<int> used{0};
  std::atomic<int> most{0};
  std::vector<std::future<void>> tasks;
  const auto work = [&](int cores) {
    const int now = used += cores;
    int seen = most;
    while (now > seen && !most.compare_exchange_weak(seen, now)) {
    }
    std::this_thread::sleep_for(milliseconds(1));
    used -= cores;
  };
  for (int i = 0; i < 100; ++i) {
    tasks.push_back(Submit(pool, i % 2 == 0 ? Lane::kSearch : Lane::kUpload, work));
    if (i % 20 == 0) {
      const auto lease = pool.BorrowCores(2);
      work(lease->cores());
    }
  }
  for (auto& task : tasks) task.get();
  EXPECT_LE(most, kCores);
  EXPECT_EQ(pool.load().busy_cores, 0);
}

TEST(WorkerPool, LeavesOneCoreToTheTasks) {
  WorkerPool pool({.cores = 2});
  const auto lease = pool.BorrowCores(5);
  EXPECT_EQ(lease->cores(), 1);
  EXPECT_EQ(pool.BorrowCores(1)->cores(), 0);
  int cores = 0;
  pool.Run(Lane::kSearch, [&](int given) { cores = given; });
  EXPECT_EQ(cores, 1);
  WorkerPool single({.cores = 1});
  EXPECT_EQ(single.BorrowCores(1)->cores(), 0);
}

TEST(WorkerPool, RefusesWhenTheLaneIsFull) {
  WorkerPool pool({.cores = 1, .queue_length = 1});
  std::latch open(1);
  auto running = Submit(pool, Lane::kUpload, [&](int) { open.wait(); });
  while (pool.load().busy_cores == 0) std::this_thread::sleep_for(milliseconds(1));
  auto waiting = Submit(pool, Lane::kUpload, [](int) {});
  AwaitWaiting(pool, 1);
  auto refused = Submit(pool, Lane::kUpload, [](int) { FAIL(); });
  EXPECT_EQ(CodeOf(refused), "busy");
  auto other_lane = Submit(pool, Lane::kSearch, [](int) {});
  AwaitWaiting(pool, 2);
  open.count_down();
  running.get();
  waiting.get();
  other_lane.get();
}

TEST(WorkerPool, GivesUpWaiting) {
  WorkerPool pool({.cores = 1, .queue_timeout = milliseconds(20)});
  std::latch open(1);
  auto running = Submit(pool, Lane::kUpload, [&](int) { open.wait(); });
  while (pool.load().busy_cores == 0) std::this_thread::sleep_for(milliseconds(1));
  bool ran = false;
  auto late = Submit(pool, Lane::kSearch, [&](int) { ran = true; });
  EXPECT_EQ(CodeOf(late), "busy");
  open.count_down();
  running.get();
  pool.Run(Lane::kSearch, [](int) {});
  EXPECT_FALSE(ran);
}

// In which order a pool of one core runs tasks that all wait: a letter each, of s, u and b.
std::string OrderOf(const std::string& submitted) {
  WorkerPool pool({.cores = 1});
  std::latch open(1);
  auto running = Submit(pool, Lane::kUpload, [&](int) { open.wait(); });
  while (pool.load().busy_cores == 0) std::this_thread::sleep_for(milliseconds(1));
  std::string order;
  std::vector<std::future<void>> tasks;
  for (const char letter : submitted) {
    const Lane lane = letter == 's'   ? Lane::kSearch
                      : letter == 'u' ? Lane::kUpload
                                      : Lane::kBackground;
    tasks.push_back(Submit(pool, lane, [&order, letter](int) { order += letter; }));
  }
  const auto waiting = [&] {
    const WorkerPool::Load load = pool.load();
    return load.waiting_searches + load.waiting_uploads + load.waiting_background;
  };
  while (waiting() < submitted.size()) std::this_thread::sleep_for(milliseconds(1));
  open.count_down();
  running.get();
  for (auto& task : tasks) task.get();
  return order;
}

TEST(WorkerPool, SearchesGoFirstButUploadsGetTheirTurn) {
  EXPECT_EQ(OrderOf("uussssss"), "ssssussu");
}

TEST(WorkerPool, BackgroundGetsItsTurnHoweverManySearchesWait) {
  const std::string most(16, 's');
  EXPECT_EQ(OrderOf("bbb" + std::string(40, 's')), most + 'b' + most + 'b' + "ssssssss" + 'b');
}

TEST(WorkerPool, BackgroundTakesHalfOfTheCoresAndGoesLast) {
  WorkerPool pool({.cores = 2, .queue_length = 1});
  std::latch open(1);
  std::atomic<int> running{0};
  std::vector<std::future<void>> background;
  for (int i = 0; i < 3; ++i) {  // more than the queue is long: they are not refused
    background.push_back(Submit(pool, Lane::kBackground, [&](int cores) {
      EXPECT_EQ(cores, 1);
      ++running;
      open.wait();
    }));
  }
  while (running == 0 || pool.load().waiting_background < 2) {
    std::this_thread::sleep_for(milliseconds(1));
  }
  int cores = 0;
  pool.Run(Lane::kSearch, [&](int given) { cores = given; });
  EXPECT_EQ(cores, 1) << "the other core is free for a search";
  EXPECT_EQ(running, 1);
  open.count_down();
  for (auto& task : background) task.get();
  EXPECT_EQ(running, 3);
}

TEST(WorkerPool, EndDropsWhatWaitsAndWaitsForWhatRuns) {
  auto pool = std::make_unique<WorkerPool>(WorkerPoolOptions{.cores = 1});
  std::latch open(1);
  auto running = Submit(*pool, Lane::kUpload, [&](int) { open.wait(); });
  while (pool->load().busy_cores == 0) std::this_thread::sleep_for(milliseconds(1));
  auto waiting = Submit(*pool, Lane::kUpload, [](int) { FAIL(); });
  AwaitWaiting(*pool, 1);
  auto ending = std::async(std::launch::async, [&] { pool.reset(); });
  EXPECT_EQ(CodeOf(waiting), "stopping");
  EXPECT_EQ(ending.wait_for(milliseconds(10)), std::future_status::timeout);
  open.count_down();
  EXPECT_EQ(CodeOf(running), "");
  ending.get();
}

}  // namespace
}  // namespace pliant::server
