// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A token bucket for each key: `rate` requests a second in the long run, `burst` at once.
#pragma once

#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>
#include <unordered_map>

namespace pliant::server {

// Thread-safe.
class RateLimiter {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t kMaxBuckets = 10'000;

  // `rate` 0 = no limit; `burst` at least 1.
  RateLimiter(double rate, double burst) : rate_(rate), burst_(burst) {}

  // Takes one token of `who`. 0 = it was there; else nothing is taken, and so many whole seconds
  // (at least 1) pass until it would be.
  int Take(const std::string& who, Clock::time_point now = Clock::now());

 private:
  struct Bucket {
    double tokens = 0;
    Clock::time_point filled;
  };
  double TokensOf(const Bucket& bucket, Clock::time_point now) const;

  const double rate_;
  const double burst_;
  std::mutex mutex_;  // guards buckets_
  std::unordered_map<std::string, Bucket> buckets_;
};

}  // namespace pliant::server
