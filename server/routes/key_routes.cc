// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// API keys over HTTP, for those who may do everything: the same as `pliant-server keys`.
#include <algorithm>
#include <memory>
#include <mutex>

#include "descriptor/base/error.h"
#include "server/auth/api_keys.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {
namespace {

bool Works(const ApiKeyRecord& key) { return key.revoked_ms == 0; }

bool IsWorkingAdmin(const ApiKeyRecord& key) {
  return Works(key) && key.scope == ScopeName(Scope::kAdmin);
}

std::string NameOf(const Parameters& parameters) {
  const std::string name = parameters.Text("name").value();
  try {
    CheckKeyName(name);
  } catch (const Error& error) {
    ThrowInvalid("name", std::string(error.what()) + ".");
  }
  return name;
}

Response List(Service& service) {
  Json items = Json::array();
  for (const ApiKeyRecord& key : service.store().Keys()) items.push_back(KeyJson(key));
  return JsonResponse({{"keys", items}});
}

Response Create(Service& service, const Request& request, const Parameters& parameters) {
  const std::string name = NameOf(parameters);
  const Scope scope =
      parameters
          .Choice<Scope>(
              "scope", {{"read", Scope::kRead}, {"write", Scope::kWrite}, {"admin", Scope::kAdmin}})
          .value_or(Scope::kRead);
  // The first key closes the server to all others; without one of scope admin nobody could open it
  // again from here.
  if (request.caller.key_id.empty() && scope != Scope::kAdmin) {
    throw ProblemError("first_key_admin",
                       "From the first key on, nothing is answered without one. Make one of scope "
                       "admin first.");
  }
  const NewKey made = MakeApiKey(name, scope);
  service.store().AddKey(made.record);
  Json json = KeyJson(made.record);
  json["key"] = made.key;
  Response response = JsonResponse(json, 201);
  response.headers.emplace_back("Location", "/v1/keys/" + made.record.id);
  return response;
}

Response Revoke(Service& service, const Request& request) {
  const std::string& id = request.captures.at("k");
  const std::vector<ApiKeyRecord> keys = service.store().Keys();
  const auto found = std::find_if(keys.begin(), keys.end(), [&](const ApiKeyRecord& key) {
    return key.id == id && Works(key);
  });
  if (found == keys.end()) throw ProblemError("key_not_found", "No working key has this id.");
  if (IsWorkingAdmin(*found) && std::count_if(keys.begin(), keys.end(), IsWorkingAdmin) == 1) {
    throw ProblemError("last_admin_key",
                       "This is the last key of scope admin: without it nobody could make or "
                       "revoke keys here. Make another one first.");
  }
  if (!service.store().RevokeKey(id)) {
    throw ProblemError("key_not_found", "No working key has this id.");
  }
  Response response;
  response.status = 204;
  return response;
}

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

void AddKeyRoutes(Service& service, std::vector<Route>& routes) {
  // Two requests must not revoke the last two keys of scope admin at once.
  const auto one_at_a_time = std::make_shared<std::mutex>();
  routes.push_back(
      {.name = "keys.list",
       .method = "GET",
       .pattern = "/v1/keys",
       .summary = "API keys, oldest first, those that were revoked included; never the keys "
                  "themselves",
       .scope = Scope::kAdmin,
       .answers = {{200, "all of them", "KeyList"}},
       .example = R"(curl -H "Authorization: Bearer $ADMIN_KEY" "$PLIANT/v1/keys")",
       .handler = [&service](const Request&, const Parameters&) { return List(service); }});
  routes.push_back(
      {.name = "keys.create",
       .method = "POST",
       .pattern = "/v1/keys",
       .summary = "Make an API key. The answer is the only one that shows it: the server keeps its "
                  "SHA-256",
       .scope = Scope::kAdmin,
       .body = BodyKind::kJson,
       .parameters = {Parameter("name", "what it is for").Required(),
                      Parameter("scope",
                                "what it allows: read, write (and read) or admin "
                                "(everything)")
                          .Choice({"read", "write", "admin"})
                          .Default("read")},
       .answers = {{201, "the key, this once; Location has its address", "NewKey"}},
       .codes = {"first_key_admin"},
       .example =
           R"(curl -H "Authorization: Bearer $ADMIN_KEY" -H "Content-Type: application/json" )"
           R"(-d '{"name": "front desk", "scope": "read"}' "$PLIANT/v1/keys")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return Create(service, request, parameters);
       }});
  routes.push_back(
      {.name = "keys.revoke",
       .method = "DELETE",
       .pattern = "/v1/keys/{k}",
       .summary = "Revoke an API key, from the next request on",
       .scope = Scope::kAdmin,
       .answers = {{204, "revoked", "", ""}},
       .codes = {"key_not_found", "last_admin_key"},
       .example =
           R"(curl -X DELETE -H "Authorization: Bearer $ADMIN_KEY" "$PLIANT/v1/keys/$KEY_ID")",
       .handler = [&service, one_at_a_time](const Request& request, const Parameters&) {
         const std::lock_guard lock(*one_at_a_time);
         return Revoke(service, request);
       }});
}

void AddMeRoute(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "me",
       .method = "GET",
       .pattern = "/v1/me",
       .summary = "What the caller may do: the scopes of its key, and whether images are fetched",
       .answers = {{200, "the caller", "Me"}},
       .example = R"(curl "$PLIANT/v1/me")",
       .handler =
           [&service](const Request& request, const Parameters&) {
             return JsonResponse(MeJson(request.caller, service.fetcher.on()));
           },
       .needs_index = false});
}

}  // namespace pliant::server
