// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Group commit for many threads: whoever finds nobody at work takes everything that waits, and does
// it at once. Private to index/store/.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <span>

namespace pliant {

class GroupQueue {
 public:
  static constexpr std::size_t kMaxBatch = 64;

  struct Job {
    bool alone = false;          // never together with others
    std::exception_ptr failure;  // set by who does it; thrown by Run
    bool done = false;
  };
  // Must not throw: what goes wrong goes into the failures of the jobs.
  using Execute = std::function<void(std::span<Job* const> batch)>;

  // Returns when the job was done, by this thread or another. Thread-safe; `execute` runs in one
  // thread at a time.
  void Run(Job& job, const Execute& execute);

 private:
  std::size_t NextBatch() const;  // how many of jobs_, from the first; mutex_ held

  std::mutex mutex_;  // guards all below, and Job::done
  std::condition_variable changed_;
  std::deque<Job*> jobs_;
  bool busy_ = false;
};

}  // namespace pliant
