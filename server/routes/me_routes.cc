// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the caller may do.
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Json MeJson(const Caller& caller) {
  Json scopes = Json::array();
  for (const Scope scope : {Scope::kRead, Scope::kWrite, Scope::kAdmin}) {
    if (scope <= caller.scope) scopes.push_back(ScopeName(scope));
  }
  // Who is admitted without a key would be with any.
  const bool keys_required = !caller.key_id.empty();
  Json key = nullptr;
  if (keys_required) {
    key = {{"id", caller.key_id}, {"name", caller.key_name}, {"scope", ScopeName(caller.scope)}};
  }
  return {{"keys_required", keys_required}, {"scopes", scopes}, {"key", key}};
}

}  // namespace

void AddMeRoute(std::vector<Route>& routes) {
  routes.push_back(
      {.name = "me",
       .method = "GET",
       .pattern = "/v1/me",
       .summary = "What the caller may do: the scopes of its key",
       .answers = {{200, "the caller", "Me"}},
       .example = R"(curl "$PLIANT/v1/me")",
       .handler = [](const Request& request,
                     const Parameters&) { return JsonResponse(MeJson(request.caller)); },
       .needs_index = false});
}

}  // namespace pliant::server
