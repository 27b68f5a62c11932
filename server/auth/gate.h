// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Who may do what, and how often: asked for every request before its body is read.
#pragma once

#include <string>

#include "server/auth/api_keys.h"
#include "server/auth/rate_limiter.h"
#include "server/http/router.h"

namespace pliant::server {

// Thread-safe.
class Gate {
 public:
  // `open_without_keys`: as long as no key was ever made, everybody may do everything.
  Gate(KeyRing& keys, double rate, double burst, bool open_without_keys)
      : keys_(keys), limiter_(rate, burst), open_without_keys_(open_without_keys) {}

  // Sets request.key_id. Throws ProblemError "unauthorized" without a key that works where one is
  // needed, "forbidden" when its scope does not include the route's, "rate_limited".
  void Admit(const Route& route, Request& request);

 private:
  KeyRing& keys_;
  RateLimiter limiter_;
  const bool open_without_keys_;
};

}  // namespace pliant::server
