// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// API keys over HTTP, for admins: the same as `pliant-server keys`.
#include <algorithm>
#include <mutex>

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

Response List(Service& service, const Request&, const Parameters&) {
  Json items = Json::array();
  for (const ApiKeyRecord& key : service.store().Keys()) items.push_back(KeyJson(key));
  return JsonResponse({{"keys", items}});
}

Response Create(Service& service, const Request& request, const Parameters& parameters) {
  const std::string name = parameters.Text("name").value();
  CheckKeyName(name);
  const Scope scope = ScopeFromName(parameters.Value<std::string>("scope")).value();
  // The first key closes the server to callers without a key. If it were not an admin key, nobody
  // could create keys over HTTP.
  if (request.caller.key_id.empty() && scope != Scope::kAdmin) {
    throw ProblemError("first_key_admin",
                       "Create an admin key first. From the first key on, the server refuses "
                       "requests without a key.");
  }
  const NewKey made = MakeApiKey(name, scope);
  service.store().AddKey(made.record);
  Json json = KeyJson(made.record);
  json["key"] = made.key;
  return JsonResponse(json, 201, "/v1/keys/" + made.record.id);
}

Response Revoke(Service& service, const Request& request, const Parameters&) {
  // Two requests must not revoke the last two admin keys at the same time.
  static std::mutex one_at_a_time;
  const std::lock_guard lock(one_at_a_time);
  const std::string& id = request.captures.at("k");
  const std::vector<ApiKeyRecord> keys = service.store().Keys();
  const auto found = std::find_if(keys.begin(), keys.end(), [&](const ApiKeyRecord& key) {
    return key.id == id && Works(key);
  });
  if (found != keys.end() && IsWorkingAdmin(*found) &&
      std::count_if(keys.begin(), keys.end(), IsWorkingAdmin) == 1) {
    throw ProblemError("last_admin_key",
                       "This is the last admin key. Without it nobody can create or revoke keys "
                       "over HTTP. Create another admin key first.");
  }
  if (found == keys.end() || !service.store().RevokeKey(id)) {
    throw ProblemError("key_not_found", "No valid key has the id '" + id + "'.");
  }
  return {.status = 204};
}

Response Me(Service& service, const Request& request, const Parameters&) {
  const Caller& caller = request.caller;
  Json scopes = Json::array();
  for (const Scope scope : {Scope::kRead, Scope::kWrite, Scope::kAdmin}) {
    if (scope <= caller.scope) scopes.push_back(ScopeName(scope));
  }
  // A server that requires keys admits nobody without one.
  const bool keys_required = !caller.key_id.empty();
  Json key = nullptr;
  if (keys_required) {
    key = {{"id", caller.key_id}, {"name", caller.key_name}, {"scope", ScopeName(caller.scope)}};
  }
  return JsonResponse({{"keys_required", keys_required},
                       {"scopes", scopes},
                       {"key", key},
                       {"image_url", service.fetcher.on()},
                       {"backups", !service.options.backup_dir.empty()}});
}

}  // namespace

void AddKeyRoutes(RouteTable& table) {
  table.Add("GET /v1/keys", "keys.list", List)
      .Summary("List all API keys without their secrets, oldest first; revoked keys are included")
      .Needs(Scope::kAdmin)
      .Answers(200, "all keys", "KeyList")
      .Example(R"(-H "Authorization: Bearer $ADMIN_KEY")");
  table.Add("POST /v1/keys", "keys.create", Create)
      .Summary("Create an API key. Only this answer shows it: the server stores its SHA-256")
      .Needs(Scope::kAdmin)
      .Takes(
          {Parameter("name", "name of the key, for people").Required(),
           Parameter("scope",
                     "read, write (includes read), admin (everything), or peer (for other servers)")
               .Choice({"read", "write", "admin", "peer"})
               .Default("read")})
      .Answers(201, "the key, shown only here; Location has its address", "NewKey")
      .Codes({"first_key_admin"})
      .Example(R"(-H "Authorization: Bearer $ADMIN_KEY" -H "Content-Type: application/json" )"
               R"(-d '{"name": "front desk", "scope": "read"}')");
  table.Add("DELETE /v1/keys/{k}", "keys.revoke", Revoke)
      .Summary("Revoke an API key; the server refuses it from the next request on")
      .Needs(Scope::kAdmin)
      .Answers(204, "revoked")
      .Codes({"last_admin_key"})
      .Example(R"(-H "Authorization: Bearer $ADMIN_KEY")");
  table.Add("GET /v1/me", "me", Me)
      .Summary("Get what the caller can do: its scopes, and what the server is set up for")
      .Answers(200, "the caller", "Me")
      .WithoutIndex();
}

}  // namespace pliant::server
