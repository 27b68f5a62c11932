// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Aliases: other names of collections, which can be moved from one to another at once.
#include <algorithm>

#include "index/json/record_json.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/changes.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMostAliasesAtOnce = 1000;

Json AliasJson(const AliasRecord& alias) {
  return {{"name", alias.name},
          {"collection", alias.collection},
          {"updated_at", IsoTime(alias.updated_ms)}};
}

Response List(Service& service) {
  Json items = Json::array();
  for (const AliasRecord& alias : service.engine().ListAliases()) items.push_back(AliasJson(alias));
  return JsonResponse({{"aliases", std::move(items)}});
}

std::optional<AliasRecord> Find(Service& service, const std::string& name) {
  for (AliasRecord& alias : service.engine().ListAliases()) {
    if (alias.name == name) return std::move(alias);
  }
  return std::nullopt;
}

Response Get(Service& service, const Request& request) {
  const std::string& name = request.captures.at("a");
  if (const auto alias = Find(service, name)) return JsonResponse(AliasJson(*alias));
  throw ProblemError("alias_not_found", "There is no alias '" + name + "'.");
}

Response Put(Service& service, const Request& request, const Parameters& parameters) {
  const std::string& name = request.captures.at("a");
  const std::string collection = parameters.Text("collection").value();
  const bool created = !Find(service, name);
  service.engine().ChangeAliases({{name, collection}});
  const auto now = Find(service, name);
  Response response =
      JsonResponse(now ? AliasJson(*now) : Json{{"name", name}, {"collection", collection}},
                   created ? 201 : 200);
  if (created) response.headers.emplace_back("Location", "/v1/aliases/" + EncodeSegment(name));
  return response;
}

Response Change(Service& service, const Request& request) {
  const Json patch = MergePatchOf(request, {});
  if (patch.size() > kMostAliasesAtOnce) {
    ThrowInvalid("body", "At most 1000 aliases can be changed at once.");
  }
  AliasChanges changes;
  for (const auto& [name, collection] : patch.items()) {
    changes[name] = TextIn(patch, name);
    if (collection.is_null()) changes[name] = std::nullopt;
  }
  service.engine().ChangeAliases(changes);
  return List(service);
}

Response Remove(Service& service, const Request& request) {
  service.engine().ChangeAliases({{request.captures.at("a"), std::nullopt}});
  return {.status = 204};
}

void AddReading(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "aliases.list",
       .method = "GET",
       .pattern = "/v1/aliases",
       .summary = "Aliases: other names of collections, good in every path that has a collection",
       .answers = {{200, "all of them, in order", "AliasList"}},
       .example = R"(curl "$PLIANT/v1/aliases")",
       .handler = [&service](const Request&, const Parameters&) { return List(service); }});
  routes.push_back({.name = "aliases.get",
                    .method = "GET",
                    .pattern = "/v1/aliases/{a}",
                    .summary = "Which collection an alias stands for",
                    .answers = {{200, "the alias", "Alias"}},
                    .codes = {"alias_not_found"},
                    .example = R"(curl "$PLIANT/v1/aliases/live")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Get(service, request);
                    }});
}

}  // namespace

void AddAliasRoutes(Service& service, std::vector<Route>& routes) {
  AddReading(service, routes);
  routes.push_back(
      {.name = "aliases.patch",
       .method = "PATCH",
       .pattern = "/v1/aliases",
       .summary = "Set, move and remove several aliases at once: no request sees some of them",
       .scope = Scope::kAdmin,
       .body = BodyKind::kMergePatch,
       .body_schema = "AliasesPatch",
       .answers = {{200, "all aliases as they are now", "AliasList"}},
       .codes = {"alias_not_found", "collection_not_found", "collection_exists"},
       .example = R"(curl -X PATCH -H "Content-Type: application/merge-patch+json" )"
                  R"(-d '{"live": "default", "before": null}' "$PLIANT/v1/aliases")",
       .handler = [&service](const Request& request, const Parameters&) {
         return Change(service, request);
       }});
  routes.push_back(
      {.name = "aliases.put",
       .method = "PUT",
       .pattern = "/v1/aliases/{a}",
       .summary = "Make an alias, or move it to another collection",
       .scope = Scope::kAdmin,
       .body = BodyKind::kJson,
       .parameters =
           {Parameter("collection", "that it is to stand for; itself no alias").Required()},
       .answers = {{201, "made", "Alias"}, {200, "moved, or as it was", "Alias"}},
       .codes = {"collection_not_found", "collection_exists", "invalid_parameter"},
       .example = R"(curl -X PUT -H "Content-Type: application/json" )"
                  R"(-d '{"collection": "default"}' "$PLIANT/v1/aliases/live")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return Put(service, request, parameters);
       }});
  routes.push_back({.name = "aliases.delete",
                    .method = "DELETE",
                    .pattern = "/v1/aliases/{a}",
                    .summary = "Remove an alias; the collection stays",
                    .scope = Scope::kAdmin,
                    .answers = {{204, "gone", "", ""}},
                    .codes = {"alias_not_found"},
                    .example = R"(curl -X DELETE "$PLIANT/v1/aliases/old")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Remove(service, request);
                    }});
}

}  // namespace pliant::server
