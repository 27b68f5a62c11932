// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Authentication, authorisation and rate limits: checked for every request before its body is read.
#pragma once

#include <string>

#include "server/auth/api_keys.h"
#include "server/auth/rate_limiter.h"
#include "server/http/router.h"

namespace pliant::server {

// Thread-safe.
class Gate {
 public:
  // `open_without_keys`: all requests are allowed as long as no key was ever created.
  Gate(KeyRing& keys, double rate, double burst, bool open_without_keys)
      : keys_(keys), limiter_(rate, burst), open_without_keys_(open_without_keys) {}

  // Sets request.caller. Throws ProblemError "unauthorized" without a valid key where one is
  // required, "forbidden" when its scope does not include the route's, "rate_limited".
  void Admit(const Route& route, Request& request);

 private:
  KeyRing& keys_;
  RateLimiter limiter_;
  const bool open_without_keys_;
};

}  // namespace pliant::server
