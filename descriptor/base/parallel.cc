// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace pliant {

int ResolveThreads(int threads) {
  if (threads > 0) return threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

std::size_t ParallelWorkers(std::size_t n, int threads) {
  return std::min<std::size_t>(n, static_cast<std::size_t>(ResolveThreads(threads)));
}

void ParallelFor(std::size_t n, int threads, const std::function<void(std::size_t)>& body) {
  ParallelForWorkers(n, threads, [&body](std::size_t i, std::size_t) { body(i); });
}

void ParallelForWorkers(std::size_t n, int threads,
                        const std::function<void(std::size_t, std::size_t)>& body) {
  const std::size_t workers = ParallelWorkers(n, threads);
  if (workers <= 1) {
    for (std::size_t i = 0; i < n; ++i) body(i, 0);
    return;
  }
  std::atomic<std::size_t> next{0};
  std::mutex mutex;  // guards failure and failed_at
  std::exception_ptr failure;
  std::size_t failed_at = n;
  const auto work = [&](std::size_t worker) {
    for (std::size_t i = next++; i < n; i = next++) {
      try {
        body(i, worker);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (i < failed_at) {
          failed_at = i;
          failure = std::current_exception();
        }
        next = n;
      }
    }
  };
  {
    std::vector<std::jthread> pool;
    pool.reserve(workers - 1);
    try {
      for (std::size_t t = 1; t < workers; ++t) pool.emplace_back(work, t);
    } catch (const std::system_error&) {
      // The system has no more threads: those that started, and this one, do all the work.
    }
    work(0);
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace pliant
