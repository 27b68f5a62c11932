// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Demonstration objects for a first visit.
#include <charconv>

#include "descriptor/simulation/demonstration.h"
#include "server/http/problem.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response Get(Service& service, const Request& request) {
  const std::string& collection = CollectionOf(service, request);
  Json objects = Json::array();
  const auto& names = simulation::DemonstrationObjects();
  for (std::size_t number = 0; number < names.size(); ++number) {
    objects.push_back({{"object", names[number]},
                       {"image_id", DemonstrationId(number)},
                       {"crumpled", "/v1/demo/" + std::to_string(number)}});
  }
  return JsonResponse(
      {{"loaded", HasDemonstration(service.engine(), collection)}, {"objects", objects}});
}

Response Load(Service& service, const Request& request) {
  return JobResponse(
      AddDemonstrationJob(service.engine(), *service.jobs, CollectionOf(service, request)));
}

Response Crumpled(Service& service, const Request& request) {
  const std::string& text = request.captures.at("n");
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool is_number = error == std::errc() && end == text.data() + text.size();
  std::shared_ptr<const std::string> jpeg;
  if (is_number) {
    service.pool.Run(WorkerPool::Lane::kSearch,
                     [&](int) { jpeg = service.crumpled_pictures.Get(number); });
  }
  if (!jpeg) {
    throw ProblemError("demo_not_found", "There is no demonstration object '" + text + "'.");
  }
  Response response;
  response.content_type = "image/jpeg";
  response.body = *jpeg;
  response.headers.emplace_back("Cache-Control", "private, max-age=3600");
  return response;
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
  routes.push_back({.name = "demo.crumpled",
                    .method = "GET",
                    .pattern = "/v1/demo/{n}",
                    .summary = "A demonstration object crumpled, to search with",
                    .answers = {{200, "the picture", "", "image/jpeg"}},
                    .codes = {"demo_not_found", "busy"},
                    .example = R"(curl "$PLIANT/v1/demo/0")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Crumpled(service, request);
                    }});
}

}  // namespace pliant::server
