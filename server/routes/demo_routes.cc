// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Demonstration objects for a first visit.
#include <charconv>

#include "descriptor/simulation/demonstration.h"
#include "server/problem.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response Get(Service& service, const Request& request) {
  const std::string& collection = CollectionOf(request);
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
  const JobStatus job =
      AddDemonstrationJob(service.engine(), service.pool, *service.jobs, service.auto_trainer(),
                          service.crumpled_pictures, CollectionOf(request));
  Response response = JsonResponse(JobJson(job), 202);
  response.headers.emplace_back("Location", "/v1/jobs/" + job.id);
  return response;
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
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Get(service, request);
                    }});
  routes.push_back({.name = "demo.load",
                    .method = "POST",
                    .pattern = "/v1/collections/{c}/demo",
                    .scope = Scope::kWrite,
                    .body = BodyKind::kJson,
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Load(service, request);
                    }});
  routes.push_back({.name = "demo.crumpled",
                    .method = "GET",
                    .pattern = "/v1/demo/{n}",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Crumpled(service, request);
                    }});
}

}  // namespace pliant::server
