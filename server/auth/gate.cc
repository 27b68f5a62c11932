// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/auth/gate.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "server/http/problem.h"

namespace pliant::server {

double RateLimiter::TokensOf(const Bucket& bucket, Clock::time_point now) const {
  const std::chrono::duration<double> since = now - bucket.filled;
  return std::min(burst_, bucket.tokens + rate_ * since.count());
}

RateLimiter::Taken RateLimiter::Take(const std::string& who, Clock::time_point now) {
  if (rate_ <= 0) return {};
  const std::lock_guard lock(mutex_);
  if (buckets_.size() >= kMaxBuckets && !buckets_.contains(who)) {
    // A full bucket equals none.
    std::erase_if(buckets_,
                  [&](const auto& entry) { return TokensOf(entry.second, now) >= burst_; });
    if (buckets_.size() >= kMaxBuckets) return {.wait_s = 1, .reset_s = 1};  // too many callers
  }
  Bucket& bucket = buckets_.try_emplace(who, Bucket{burst_, now}).first->second;
  bucket.tokens = TokensOf(bucket, now);
  bucket.filled = now;
  const auto seconds_to = [&](double tokens) {
    return static_cast<int>(std::ceil((tokens - bucket.tokens) / rate_));
  };
  Taken taken;
  if (bucket.tokens >= 1) {
    bucket.tokens -= 1;
  } else {
    taken.wait_s = std::max(1, seconds_to(1));
  }
  taken.remaining = static_cast<int>(bucket.tokens);
  taken.reset_s = seconds_to(burst_);
  return taken;
}

void Gate::Admit(const Route& route, Request& request) {
  if (route.scope == Scope::kPublic) return;
  const bool open = open_without_keys_ && !keys_.InUse();
  if (!open) {
    const auto caller = keys_.Identify(request);
    if (!caller) {
      throw ProblemError("unauthorized",
                         "This request needs a key. Send it as \"Authorization: Bearer KEY\" or "
                         "\"X-API-Key: KEY\". The operator creates keys with pliant-server keys "
                         "create.");
    }
    request.caller = *caller;
    const bool for_peers = route.scope == Scope::kPeer;
    if (for_peers || caller->scope == Scope::kPeer ? caller->scope != route.scope
                                                   : caller->scope < route.scope) {
      throw ProblemError("forbidden",
                         fmt::format("This route needs a key with scope {}. This key has scope {}.",
                                     ScopeName(route.scope), ScopeName(caller->scope)));
    }
  } else {
    request.caller = {.scope = Scope::kAdmin};
  }
  if (limit_ == 0 || route.scope == Scope::kPeer) return;
  const auto taken = limiter_.Take(open ? request.remote_address : request.caller.key_id);
  request.answer_headers = {{"RateLimit-Limit", std::to_string(limit_)},
                            {"RateLimit-Remaining", std::to_string(taken.remaining)},
                            {"RateLimit-Reset", std::to_string(taken.reset_s)}};
  if (taken.wait_s > 0) {
    throw ProblemError("rate_limited", "Too many requests. Try again shortly.",
                       {.retry_after_s = taken.wait_s});
  }
}

}  // namespace pliant::server
