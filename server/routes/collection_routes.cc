// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Collections: separate images, objects and vocabularies.
#include "index/json/record_json.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/changes.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response List(Service& service) {
  Json names = Json::array();
  Json labels = Json::array();
  for (const CollectionLabel& label : service.engine().ListLabels()) {
    names.push_back(label.name);
    labels.push_back({{"name", label.name},
                      {"display_name", TextOrNull(label.display_name)},
                      {"aliases", label.aliases}});
  }
  return JsonResponse({{"collections", std::move(names)}, {"labels", std::move(labels)}});
}

Response Put(Service& service, const Request& request) {
  const std::string& name = request.captures.at("c");
  const bool created = service.engine().CreateCollection(name);
  Response response =
      JsonResponse(CollectionJson(service.engine().GetCollection(name)), created ? 201 : 200);
  if (created) {
    response.headers.emplace_back("Location", "/v1/collections/" + EncodeSegment(name));
  }
  return response;
}

Response Change(Service& service, const Request& request) {
  const Json patch = MergePatchOf(request, {"display_name"});
  return JsonResponse(CollectionJson(service.engine().ChangeCollection(
      CollectionOf(service, request), {.display_name = TextIn(patch, "display_name")})));
}

Response Remove(Service& service, const Request& request) {
  const std::string& name = request.captures.at("c");
  if (!service.engine().RemoveCollection(name)) {
    throw ProblemError("collection_not_found", "There is no collection '" + name + "'.");
  }
  return {.status = 204};
}

}  // namespace

void AddCollectionRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "collections.list",
       .method = "GET",
       .pattern = "/v1/collections",
       .summary = "All collections, with their names for people and their aliases",
       .answers = {{200, "in order of their names", "CollectionList"}},
       .example = R"(curl "$PLIANT/v1/collections")",
       .handler = [&service](const Request&, const Parameters&) { return List(service); }});
  routes.push_back({.name = "collections.get",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}",
                    .summary = "One collection: how much is in it, its vocabulary",
                    .answers = {{200, "the collection", "Collection"}},
                    .example = R"(curl "$PLIANT/v1/collections/default")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return JsonResponse(CollectionJson(
                          service.engine().GetCollection(CollectionOf(service, request))));
                    }});
  routes.push_back({.name = "collections.put",
                    .method = "PUT",
                    .pattern = "/v1/collections/{c}",
                    .summary = "Make a collection; nothing happens when it is there",
                    .scope = Scope::kAdmin,
                    .answers = {{201, "made", "Collection"}, {200, "it was there", "Collection"}},
                    .codes = {"invalid_parameter"},
                    .example = R"(curl -X PUT "$PLIANT/v1/collections/tools")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Put(service, request);
                    }});
  routes.push_back({.name = "collections.patch",
                    .method = "PATCH",
                    .pattern = "/v1/collections/{c}",
                    .summary = "Give a collection a name for people",
                    .scope = Scope::kAdmin,
                    .body = BodyKind::kMergePatch,
                    .body_schema = "CollectionPatch",
                    .answers = {{200, "the collection as it is now", "Collection"}},
                    .codes = {"invalid_parameter"},
                    .example = R"(curl -X PATCH -H "Content-Type: application/merge-patch+json" )"
                               R"(-d '{"display_name": "Summer shirts 2026!"}' )"
                               R"("$PLIANT/v1/collections/default")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Change(service, request);
                    }});
  routes.push_back(
      {.name = "collections.delete",
       .method = "DELETE",
       .pattern = "/v1/collections/{c}",
       .summary = "Delete a collection with everything in it, and its aliases; `default` stays",
       .scope = Scope::kAdmin,
       .answers = {{204, "gone", "", ""}},
       .codes = {"collection_permanent", "collection_is_alias"},
       .example = R"(curl -X DELETE "$PLIANT/v1/collections/toys")",
       .handler = [&service](const Request& request, const Parameters&) {
         return Remove(service, request);
       }});
}

}  // namespace pliant::server
