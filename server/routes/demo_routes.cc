// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Demonstration objects for a first visit.
#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response Get(Service& service, const Request& request) {
  const std::string& collection = CollectionOf(service, request);
  Json objects = Json::array();
  for (const DemonstrationObject& object : kDemonstrationObjects) {
    objects.push_back({{"object", object.name},
                       {"image_id", object.id()},
                       {"crumpled", std::string("/assets/demo/") + object.file + "-crumpled.jpg"}});
  }
  return JsonResponse(
      {{"loaded", HasDemonstration(service.engine(), collection)}, {"objects", objects}});
}

Response Load(Service& service, const Request& request) {
  return JobResponse(
      AddDemonstrationJob(service.engine(), *service.jobs, CollectionOf(service, request)));
}

}  // namespace

void AddDemoRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "demo.get",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/demo",
                    .summary = "The demonstration objects, and whether they were added",
                    .answers = {{200, "all of them", "Demo"}},
                    .example = R"(curl "$PLIANT/v1/collections/default/demo")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Get(service, request);
                    }});
  routes.push_back({.name = "demo.load",
                    .method = "POST",
                    .pattern = "/v1/collections/{c}/demo",
                    .summary = "Add the demonstration objects, in the background",
                    .scope = Scope::kWrite,
                    .body = BodyKind::kJson,
                    .answers = {{202, "the job; Location has its address", "Job"}},
                    .example = R"(curl -X POST "$PLIANT/v1/collections/toys/demo")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Load(service, request);
                    }});
}

}  // namespace pliant::server
