// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/auth/rate_limiter.h"

#include <algorithm>
#include <cmath>

namespace pliant::server {

double RateLimiter::TokensOf(const Bucket& bucket, Clock::time_point now) const {
  const std::chrono::duration<double> since = now - bucket.filled;
  return std::min(burst_, bucket.tokens + rate_ * since.count());
}

int RateLimiter::Take(const std::string& who, Clock::time_point now) {
  if (rate_ <= 0) return 0;
  const std::lock_guard lock(mutex_);
  if (buckets_.size() >= kMaxBuckets && !buckets_.contains(who)) {
    // A full bucket is like none.
    std::erase_if(buckets_,
                  [&](const auto& entry) { return TokensOf(entry.second, now) >= burst_; });
    if (buckets_.size() >= kMaxBuckets) return 1;  // so many at once: come again
  }
  Bucket& bucket = buckets_.try_emplace(who, Bucket{burst_, now}).first->second;
  bucket.tokens = TokensOf(bucket, now);
  bucket.filled = now;
  if (bucket.tokens >= 1) {
    bucket.tokens -= 1;
    return 0;
  }
  return std::max(1, static_cast<int>(std::ceil((1 - bucket.tokens) / rate_)));
}

}  // namespace pliant::server
