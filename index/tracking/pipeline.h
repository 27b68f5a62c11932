// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Runs frames through a tracker, one thread per stage: decode | detect and describe | verify.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>

#include "index/tracking/frame_source.h"
#include "index/tracking/tracker.h"

namespace pliant {

// A bounded queue between two stages: one producer, one consumer.
template <typename Value>
class Channel {
 public:
  explicit Channel(std::size_t capacity) : capacity_(capacity) {}

  // Waits for space. False after Abandon(): stop producing.
  bool Push(Value value) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return values_.size() < capacity_ || abandoned_; });
    if (abandoned_) return false;
    values_.push_back(std::move(value));
    changed_.notify_all();
    return true;
  }
  // Ends the input; `error`, if any, is thrown by Pop after the last value.
  void Finish(std::exception_ptr error = nullptr) {
    const std::lock_guard lock(mutex_);
    finished_ = true;
    error_ = std::move(error);
    changed_.notify_all();
  }
  // Waits for a value; nullopt after the last.
  std::optional<Value> Pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !values_.empty() || finished_; });
    if (values_.empty()) {
      if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
      return std::nullopt;
    }
    std::optional<Value> value(std::move(values_.front()));
    values_.pop_front();
    changed_.notify_all();
    return value;
  }
  // Called by the consumer when it stops: Push returns false from now on.
  void Abandon() {
    const std::lock_guard lock(mutex_);
    abandoned_ = true;
    changed_.notify_all();
  }

 private:
  const std::size_t capacity_;
  std::mutex mutex_;  // guards the rest
  std::condition_variable changed_;
  std::deque<Value> values_;
  bool finished_ = false;
  bool abandoned_ = false;
  std::exception_ptr error_;
};

struct TrackedFrame {
  Frame frame;
  Location location;
  double describe_ms = 0;  // for this frame; the stages overlap
  double verify_ms = 0;
};

struct TrackSummary {
  std::int64_t frames = 0;  // processed
  std::int64_t found = 0;
  double inlier_rate = 0;  // mean over all frames, including lost ones
  double seconds = 0;
  double frames_per_second = 0;
};

// Calls `each` for every frame, in order, on the caller's thread; if it returns false, the
// remaining frames are skipped. Exceptions of a stage are rethrown here, after the preceding
// frames.
TrackSummary TrackFrames(FrameSource& source, const Tracker& tracker,
                         const std::function<bool(const TrackedFrame&)>& each);

}  // namespace pliant
