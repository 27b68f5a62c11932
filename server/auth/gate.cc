// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/auth/gate.h"

#include "server/http/problem.h"

namespace pliant::server {

void Gate::Admit(const Route& route, Request& request) {
  if (route.scope == Scope::kPublic) return;
  const bool open = open_without_keys_ && !keys_.InUse();
  if (!open) {
    const auto caller = keys_.Identify(request);
    if (!caller) {
      throw ProblemError("unauthorized",
                         "A key is needed: send it as \"Authorization: Bearer KEY\" or as "
                         "\"X-API-Key: KEY\". The operator makes one with pliant-server keys "
                         "create.");
    }
    request.caller = *caller;
    if (caller->scope < route.scope) {
      throw ProblemError("forbidden", std::string("The key's scope is ") +
                                          ScopeName(caller->scope) + ", but this needs " +
                                          ScopeName(route.scope) + ".");
    }
  } else {
    request.caller = {.scope = Scope::kAdmin};
  }
  const int wait_s = limiter_.Take(open ? request.remote_address : request.caller.key_id);
  if (wait_s > 0) {
    throw ProblemError("rate_limited", "Too many requests. Try again shortly.").RetryAfter(wait_s);
  }
}

}  // namespace pliant::server
