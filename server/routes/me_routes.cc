// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the caller may do.
#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Json MeJson(const Caller& caller, bool fetches) {
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
  return {
      {"keys_required", keys_required}, {"scopes", scopes}, {"key", key}, {"image_url", fetches}};
}

}  // namespace

void AddMeRoute(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "me",
       .method = "GET",
       .pattern = "/v1/me",
       .summary = "What the caller may do: the scopes of its key, and whether pictures are fetched",
       .answers = {{200, "the caller", "Me"}},
       .example = R"(curl "$PLIANT/v1/me")",
       .handler =
           [&service](const Request& request, const Parameters&) {
             return JsonResponse(MeJson(request.caller, service.fetcher.on()));
           },
       .needs_index = false});
}

}  // namespace pliant::server
