// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Collections: separate pictures, objects and vocabularies.
#include "server/problem.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Json CollectionJson(const CollectionRecord& record) {
  return {{"name", record.name},
          {"images", record.images},
          {"objects", record.objects},
          {"descriptors", record.descriptors},
          {"vocabulary", record.vocabulary ? VocabularyJson(*record.vocabulary) : Json(nullptr)},
          {"created_at", FormatTime(record.created_ms)}};
}

Response List(Service& service) {
  Json items = Json::array();
  for (const std::string& name : service.engine().ListCollections()) items.push_back(name);
  return JsonResponse({{"collections", items}});
}

Response Put(Service& service, const Request& request) {
  const std::string& name = CollectionOf(request);
  const bool created = service.engine().CreateCollection(name);
  Response response =
      JsonResponse(CollectionJson(service.engine().GetCollection(name)), created ? 201 : 200);
  if (created) {
    response.headers.emplace_back("Location", "/v1/collections/" + EncodeSegment(name));
  }
  return response;
}

Response Remove(Service& service, const Request& request) {
  const std::string& name = CollectionOf(request);
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
       .handler = [&service](const Request&, const Parameters&) { return List(service); }});
  routes.push_back({.name = "collections.get",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return JsonResponse(
                          CollectionJson(service.engine().GetCollection(CollectionOf(request))));
                    }});
  routes.push_back({.name = "collections.put",
                    .method = "PUT",
                    .pattern = "/v1/collections/{c}",
                    .scope = Scope::kAdmin,
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Put(service, request);
                    }});
  routes.push_back({.name = "collections.delete",
                    .method = "DELETE",
                    .pattern = "/v1/collections/{c}",
                    .scope = Scope::kAdmin,
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Remove(service, request);
                    }});
}

}  // namespace pliant::server
