// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Authentication, authorisation and rate limits: checked for every request before its body is read.
#pragma once

#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>
#include <unordered_map>

#include "server/auth/api_keys.h"
#include "server/http/router.h"

namespace pliant::server {

// A token bucket per key: `rate` requests per second in the long run, `burst` at once. Thread-safe.
class RateLimiter {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t kMaxBuckets = 10'000;

  // `rate` 0 = no limit; `burst` at least 1.
  RateLimiter(double rate, double burst) : rate_(rate), burst_(burst) {}

  struct Taken {
    int wait_s = 0;     // until there is a token, at least 1; 0 = one was taken
    int remaining = 0;  // tokens
    int reset_s = 0;    // until all tokens are there
  };
  // Takes one token of `who`.
  Taken Take(const std::string& who, Clock::time_point now = Clock::now());

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

// Thread-safe.
class Gate {
 public:
  // `open_without_keys`: allows all requests until a key is created.
  Gate(KeyRing& keys, double rate, double burst, bool open_without_keys)
      : keys_(keys),
        limiter_(rate, burst),
        limit_(rate > 0 ? static_cast<int>(burst) : 0),
        open_without_keys_(open_without_keys) {}

  // Sets request.caller, and request.answer_headers where a rate limit applies. Throws ProblemError
  // "unauthorized" without a valid key where one is required, "forbidden" when its scope does not
  // include the route's, "rate_limited".
  void Admit(const Route& route, Request& request);

 private:
  KeyRing& keys_;
  RateLimiter limiter_;
  const int limit_;  // 0 = none
  const bool open_without_keys_;
};

}  // namespace pliant::server
