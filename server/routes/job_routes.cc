// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Jobs: what runs in the background.
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

void AddJobRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "jobs.list",
                    .method = "GET",
                    .pattern = "/v1/jobs",
                    .handler = [&service](const Request&, const Parameters&) {
                      Json items = Json::array();
                      for (const JobStatus& job : service.jobs->List()) {
                        items.push_back(JobJson(job));
                      }
                      return JsonResponse({{"jobs", items}});
                    }});
  routes.push_back({.name = "jobs.get",
                    .method = "GET",
                    .pattern = "/v1/jobs/{id}",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return JsonResponse(JobJson(service.jobs->Get(request.captures.at("id"))));
                    }});
  routes.push_back({.name = "jobs.cancel",
                    .method = "DELETE",
                    .pattern = "/v1/jobs/{id}",
                    .scope = Scope::kWrite,
                    .handler = [&service](const Request& request, const Parameters&) {
                      return JsonResponse(JobJson(service.jobs->Cancel(request.captures.at("id"))),
                                          202);
                    }});
}

}  // namespace pliant::server
