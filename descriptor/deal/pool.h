// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Resources of a running call: oneDNN's thread count and scratch memory. Internal to deal/.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <iterator>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include <omp.h>

namespace pliant::deal {

// Sets how many threads oneDNN's primitives use when they are created or run by this thread.
class ScopedPrimitiveThreads {
 public:
  explicit ScopedPrimitiveThreads(int threads) : before_(omp_get_max_threads()) {
    omp_set_num_threads(threads);
  }
  ~ScopedPrimitiveThreads() { omp_set_num_threads(before_); }
  ScopedPrimitiveThreads(const ScopedPrimitiveThreads&) = delete;
  ScopedPrimitiveThreads& operator=(const ScopedPrimitiveThreads&) = delete;

 private:
  int before_;
};

// Reusable objects that are expensive to create and used by one call at a time (scratch memory).
// Thread-safe.
template <typename T>
class Pool {
 public:
  using Cost = std::function<std::size_t(const T&)>;

  // Those used last are kept for later, as long as their costs add up to `most` or less.
  explicit Pool(
      std::size_t most, Cost cost = [](const T&) { return std::size_t{1}; })
      : most_(most), cost_(std::move(cost)) {}

  class Lease {
   public:
    Lease(Pool& pool, std::unique_ptr<T> object) : pool_(pool), object_(std::move(object)) {}
    ~Lease() { pool_.Return(std::move(object_)); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    T& operator*() const { return *object_; }
    T* operator->() const { return object_.get(); }

   private:
    Pool& pool_;
    std::unique_ptr<T> object_;
  };

  // An idle object that `fits`, else what `make` returns.
  template <typename Fits, typename Make>
  Lease Take(const Fits& fits, const Make& make) {
    {
      const std::lock_guard lock(mutex_);
      const auto found = std::find_if(idle_.rbegin(), idle_.rend(),
                                      [&](const auto& object) { return fits(*object); });
      if (found != idle_.rend()) {
        std::unique_ptr<T> object = std::move(*found);
        idle_.erase(std::next(found).base());
        return Lease(*this, std::move(object));
      }
    }
    return Lease(*this, make());
  }

 private:
  void Return(std::unique_ptr<T> object) noexcept {
    if (cost_(*object) > most_) return;
    std::vector<std::unique_ptr<T>> dropped;  // freed outside the lock
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(object));
    std::size_t sum = 0;
    auto first = idle_.end();  // that is kept
    while (first != idle_.begin()) {
      sum += cost_(**std::prev(first));
      if (sum > most_) break;
      --first;
    }
    dropped.assign(std::make_move_iterator(idle_.begin()), std::make_move_iterator(first));
    idle_.erase(idle_.begin(), first);
  }

  const std::size_t most_;
  const Cost cost_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<T>> idle_;  // most recently used last; guarded by mutex_
};

}  // namespace pliant::deal
