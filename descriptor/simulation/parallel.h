// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A loop over independent tasks on a fixed number of threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace pliant::simulation {

// Calls task(i) for i in [0, count) on at most `jobs` threads. The first exception stops the loop
// and is thrown again here.
template <typename Task>
void ParallelFor(std::size_t count, int jobs, Task&& task) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr first;  // guarded by mutex
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        task(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!first) first = std::current_exception();
        next = count;
      }
    }
  };
  std::vector<std::jthread> threads;
  const std::size_t extra = std::min(count, static_cast<std::size_t>(std::max(1, jobs)));
  for (std::size_t i = 1; i < extra; ++i) threads.emplace_back(work);
  work();
  threads.clear();
  if (first) std::rethrow_exception(first);
}

}  // namespace pliant::simulation
