// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <list>
#include <mutex>

namespace pliant::clickhouse {

// A mutex that is waited for until a moment, first come, first served.
class Gate {
 public:
  class Pass {
   public:
    Pass(Gate& gate, std::chrono::steady_clock::time_point until) : gate_(gate) {
      std::unique_lock lock(gate_.mutex_);
      place_ = gate_.queue_.insert(gate_.queue_.end(), 0);
      passed_ =
          gate_.moved_.wait_until(lock, until, [this] { return place_ == gate_.queue_.begin(); });
      if (!passed_) gate_.queue_.erase(place_);
    }
    ~Pass() {
      if (!passed_) return;
      const std::lock_guard lock(gate_.mutex_);
      gate_.queue_.erase(place_);
      gate_.moved_.notify_all();
    }
    Pass(const Pass&) = delete;
    Pass& operator=(const Pass&) = delete;
    explicit operator bool() const { return passed_; }

   private:
    Gate& gate_;
    std::list<char>::iterator place_;
    bool passed_ = false;
  };

 private:
  std::mutex mutex_;  // guards queue_
  std::condition_variable moved_;
  std::list<char> queue_;  // the first one has passed
};

}  // namespace pliant::clickhouse
