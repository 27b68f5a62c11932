// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Resources of a running call: oneDNN's thread count and scratch memory. Internal to deal/.
#pragma once

#include <algorithm>
#include <cstddef>
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
  // At most `max_idle` objects are kept for later.
  explicit Pool(std::size_t max_idle) : max_idle_(max_idle) {}

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
    std::unique_ptr<T> oldest;  // freed outside the lock
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(object));
    if (idle_.size() > max_idle_) {
      oldest = std::move(idle_.front());
      idle_.erase(idle_.begin());
    }
  }

  const std::size_t max_idle_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<T>> idle_;  // most recently used last; guarded by mutex_
};

}  // namespace pliant::deal
