// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Cores for the parts of other servers' searches. They do not wait for the WorkerPool: its tasks
// may be searches that wait for other servers, which wait for this one.
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>

namespace pliant::server {

// Thread-safe.
class PartTurns {
 public:
  explicit PartTurns(int cores) : cores_(cores) {}

  class Turn {
   public:
    Turn(PartTurns& turns, int shared_by)
        : threads(std::max(1, turns.cores_ / shared_by)), turns_(&turns) {}
    Turn(Turn&& other) noexcept : threads(other.threads), turns_(other.turns_) {
      other.turns_ = nullptr;
    }
    ~Turn() {
      if (turns_ != nullptr) turns_->End();
    }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    Turn& operator=(Turn&&) = delete;

    const int threads;  // to use

   private:
    PartTurns* turns_;
  };
  // nullopt: all cores stayed busy.
  std::optional<Turn> Take(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    if (!free_.wait_for(lock, timeout, [this] { return busy_ < cores_; })) return std::nullopt;
    return std::optional<Turn>(std::in_place, *this, ++busy_);
  }

 private:
  void End() {
    const std::lock_guard lock(mutex_);
    --busy_;
    free_.notify_one();
  }

  const int cores_;
  std::mutex mutex_;  // guards busy_
  std::condition_variable free_;
  int busy_ = 0;
};

}  // namespace pliant::server
