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
                    .summary = "Background jobs, newest first",
                    .answers = {{200, "the jobs", "JobList"}},
                    .example = R"(curl "$PLIANT/v1/jobs")",
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
                    .summary = "How far a job is",
                    .answers = {{200, "the job", "Job"}},
                    .codes = {"job_not_found"},
                    .example = R"(curl "$PLIANT/v1/jobs/$JOB")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return JsonResponse(JobJson(service.jobs->Get(request.captures.at("id"))));
                    }});
  routes.push_back({.name = "jobs.cancel",
                    .method = "DELETE",
                    .pattern = "/v1/jobs/{id}",
                    .summary = "Cancel a job; one that has ended stays as it is",
                    .scope = Scope::kWrite,
                    .answers = {{202, "it ends soon, unless it has ended", "Job"}},
                    .codes = {"job_not_found"},
                    .example = R"(curl -X DELETE "$PLIANT/v1/jobs/$JOB")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return JsonResponse(JobJson(service.jobs->Cancel(request.captures.at("id"))),
                                          202);
                    }});
}

}  // namespace pliant::server
