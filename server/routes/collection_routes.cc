// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Collections: separate images, objects and vocabularies. Aliases: other names of collections.
#include <limits>

#include "index/json/record_json.h"
#include "server/http/problem.h"
#include "server/jobs/self_tests.h"
#include "server/routes/answers.h"
#include "server/routes/request_body.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

constexpr std::int64_t kMostTestPictures = 10'000;

Response ListCollections(Service& service, const Request&, const Parameters&) {
  Json items = Json::array();
  for (const std::string& name : service.engine().ListCollections()) {
    try {
      items.push_back(CollectionJson(service.engine().GetCollection(name)));
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;  // deleted meanwhile
    }
  }
  return JsonResponse({{"collections", std::move(items)}});
}

Response GetCollection(Service& service, const Request& request, const Parameters&) {
  return JsonResponse(CollectionJson(service.engine().GetCollection(request.captures.at("c"))));
}

Response PutCollection(Service& service, const Request& request, const Parameters&) {
  const std::string& name = request.captures.at("c");
  const bool created = service.engine().CreateCollection(name);
  const Json json = CollectionJson(service.engine().GetCollection(name));
  if (!created) return JsonResponse(json);
  return JsonResponse(json, 201, "/v1/collections/" + EncodeSegment(name));
}

Response PatchCollection(Service& service, const Request& request, const Parameters&) {
  const Json patch = MergePatchOf(request, {"display_name", "found_from"});
  CollectionChange change;
  change.display_name = TextIn(patch, "display_name");
  if (const auto it = patch.find("found_from"); it != patch.end()) {
    if (!it->is_null() && !it->is_number()) {
      ThrowInvalid("found_from", "found_from must be a number or null.");
    }
    change.found_from = it->is_null() ? kFoundProbability : it->get<double>();
  }
  return JsonResponse(
      CollectionJson(service.engine().ChangeCollection(request.captures.at("c"), change)));
}

Response StartSelfTest(Service& service, const Request& request, const Parameters& parameters) {
  SelfTestOptions options;
  options.collection = CollectionOf(service, request);
  options.pictures = parameters.Value<int>("pictures");
  options.false_alarms = parameters.Value<double>("false_alarms");
  options.seed = parameters.Value<std::uint64_t>("seed");
  return JobResponse(AddSelfTestJob(*service.jobs, options));
}

Response GetSelfTest(Service& service, const Request& request, const Parameters&) {
  const std::string report = service.engine().GetSelfTest(request.captures.at("c"));
  return JsonResponse({{"report", report.empty() ? Json(nullptr) : Json::parse(report)}});
}

Response DeleteCollection(Service& service, const Request& request, const Parameters&) {
  const std::string& name = request.captures.at("c");
  if (!service.engine().RemoveCollection(name)) {
    throw ProblemError("collection_not_found", "No collection has the name '" + name + "'.");
  }
  return {.status = 204};
}

Json AliasJson(const AliasRecord& alias) {
  return {{"name", alias.name},
          {"collection", alias.collection},
          {"updated_at", IsoTime(alias.updated_ms)}};
}

Response ListAliases(Service& service, const Request&, const Parameters&) {
  Json items = Json::array();
  for (const AliasRecord& alias : service.engine().ListAliases()) items.push_back(AliasJson(alias));
  return JsonResponse({{"aliases", std::move(items)}});
}

std::optional<AliasRecord> FindAlias(Service& service, const std::string& name) {
  for (AliasRecord& alias : service.engine().ListAliases()) {
    if (alias.name == name) return std::move(alias);
  }
  return std::nullopt;
}

Response GetAlias(Service& service, const Request& request, const Parameters&) {
  const std::string& name = request.captures.at("a");
  if (const auto alias = FindAlias(service, name)) return JsonResponse(AliasJson(*alias));
  throw ProblemError("alias_not_found", "No alias has the name '" + name + "'.");
}

Response PutAlias(Service& service, const Request& request, const Parameters& parameters) {
  const std::string& name = request.captures.at("a");
  const std::string collection = parameters.Text("collection").value_or("");
  const bool created = !FindAlias(service, name);
  service.engine().ChangeAliases({{name, collection}});
  const auto now = FindAlias(service, name);
  const Json json = now ? AliasJson(*now) : Json{{"name", name}, {"collection", collection}};
  if (!created) return JsonResponse(json);
  return JsonResponse(json, 201, "/v1/aliases/" + EncodeSegment(name));
}

Response PatchAliases(Service& service, const Request& request, const Parameters& parameters) {
  const Json patch = MergePatchOf(request, {});
  AliasChanges changes;
  for (const auto& [name, collection] : patch.items()) {
    changes[name] = TextIn(patch, name);
    if (collection.is_null()) changes[name] = std::nullopt;
  }
  service.engine().ChangeAliases(changes);
  return ListAliases(service, request, parameters);
}

Response DeleteAlias(Service& service, const Request& request, const Parameters&) {
  service.engine().ChangeAliases({{request.captures.at("a"), std::nullopt}});
  return {.status = 204};
}

void AddAliasRoutes(RouteTable& table) {
  table.Add("GET /v1/aliases", "aliases.list", ListAliases)
      .Summary("List all aliases. An alias can replace the collection's name in every path")
      .Answers(200, "all aliases by name", "AliasList");
  table.Add("GET /v1/aliases/{a}", "aliases.get", GetAlias)
      .Summary("Get one alias and its collection")
      .Answers(200, "the alias", "Alias");
  table.Add("PATCH /v1/aliases", "aliases.patch", PatchAliases)
      .Summary("Set, move and remove several aliases in one transaction")
      .Needs(Scope::kAdmin)
      .Patches("AliasesPatch")
      .Answers(200, "all aliases after the change", "AliasList")
      .Codes({"alias_not_found", "collection_not_found", "collection_exists"})
      .ExampleBody(R"({"live": "default", "before": null})");
  table.Add("PUT /v1/aliases/{a}", "aliases.put", PutAlias)
      .Summary("Create an alias, or move it to another collection")
      .Needs(Scope::kAdmin)
      .Body(BodyKind::kJson)
      .Takes({Parameter("collection", "name of the collection; not an alias").Required()})
      .Answers(201, "created", "Alias")
      .Answers(200, "moved or unchanged", "Alias")
      .Codes({"collection_not_found", "collection_exists", "invalid_parameter"})
      .ExampleBody(R"({"collection": "default"})");
  table.Add("DELETE /v1/aliases/{a}", "aliases.delete", DeleteAlias)
      .Summary("Delete an alias; the collection stays")
      .Needs(Scope::kAdmin)
      .Answers(204, "deleted")
      .Example(R"(curl -X DELETE "$PLIANT/v1/aliases/old")");
}

}  // namespace

void AddCollectionRoutes(RouteTable& table) {
  table.Add("GET /v1/collections", "collections.list", ListCollections)
      .Summary("List all collections with their display names and aliases")
      .Answers(200, "all collections by name", "CollectionList");
  table.Add("GET /v1/collections/{c}", "collections.get", GetCollection)
      .Summary("Get one collection: its counts and its active vocabulary")
      .Answers(200, "the collection", "Collection");
  table.Add("PUT /v1/collections/{c}", "collections.put", PutCollection)
      .Summary("Create a collection; an existing collection does not change")
      .Needs(Scope::kAdmin)
      .Answers(201, "created", "Collection")
      .Answers(200, "the collection existed", "Collection")
      .Codes({"invalid_parameter"})
      .Example(R"(curl -X PUT "$PLIANT/v1/collections/tools")");
  table.Add("PATCH /v1/collections/{c}", "collections.patch", PatchCollection)
      .Summary("Change the display name of a collection, or from which probability a hit is found")
      .Needs(Scope::kAdmin)
      .Patches("CollectionPatch")
      .Answers(200, "the collection after the change", "Collection")
      .Codes({"invalid_parameter"})
      .ExampleBody(R"({"display_name": "Summer shirts 2026!"})");
  table.Add("POST /v1/collections/{c}/selftest", "collections.test", StartSelfTest)
      .Summary(
          "Predict how well photos of the collection's objects will be found, in the background")
      .Takes({Parameter("pictures", "number of simulated photos of the collection's images")
                  .Integer(1, kMostTestPictures)
                  .Default("100"),
              Parameter("false_alarms",
                        "highest share of photos of absent objects that may be found; decides the "
                        "advised found_from")
                  .Number(0.0001, 0.9999)
                  .Default("0.01"),
              Parameter("seed", "the same seed and images give the same photos")
                  .Integer(0, std::numeric_limits<std::int64_t>::max())
                  .Default("1")})
      .Answers(202, "the job; its result is the report", "Job")
      .ExampleBody(R"({"pictures": 6})");
  table.Add("GET /v1/collections/{c}/selftest", "collections.tested", GetSelfTest)
      .Summary("Get the report of the collection's last self-test")
      .Answers(200, "the report; null before the first", "SelfTest");
  table.Add("DELETE /v1/collections/{c}", "collections.delete", DeleteCollection)
      .Summary("Delete a collection with its contents and its aliases, except `default`")
      .Needs(Scope::kAdmin)
      .Answers(204, "deleted")
      .Codes({"collection_permanent", "collection_is_alias"})
      .Example(R"(curl -X DELETE "$PLIANT/v1/collections/toys")");
  AddAliasRoutes(table);
}

}  // namespace pliant::server
