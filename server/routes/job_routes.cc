// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Jobs: what runs in the background.
#include <chrono>

#include "server/jobs/bulk_items.h"
#include "server/routes/answers.h"
#include "server/routes/lists.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

constexpr double kLongestWaitS = 60;

// Backups and imports of folders are begun by admins, and their records name files of the server:
// to others they are not there.
bool MaySee(const Caller& caller, const JobStatus& job) {
  return caller.scope >= Scope::kAdmin || (job.kind != "backup" && job.kind != "import");
}

// The job that the {id} of the path names. Throws ProblemError "job_not_found".
JobStatus JobOf(const JobStore& jobs, const Request& request) {
  JobStatus job = jobs.Get(request.captures.at("id"));
  if (!MaySee(request.caller, job)) ThrowJobNotFound();
  return job;
}

// The job as it is, or, when that was asked for, as soon as it has ended.
Response JobAnswer(JobStore& jobs, const Request& request, const Parameters& parameters) {
  const JobStatus job = JobOf(jobs, request);
  const std::chrono::duration<double> patience(parameters.Number("wait").value_or(0));
  if (patience.count() == 0 || request.waited || !IsActive(job.state)) {
    return JsonResponse(JobJson(job));
  }
  Response later;
  later.wait = Wait{
      std::chrono::steady_clock::now() + std::chrono::ceil<std::chrono::milliseconds>(patience),
      [&jobs, id = job.id](JobWaiters::Wake wake) { return jobs.WhenEnded(id, std::move(wake)); }};
  return later;
}

Response Items(Service& service, const Request& request, const Parameters& parameters) {
  const std::string id = JobOf(*service.jobs, request).id;
  const std::string identity = ToText(Json::array({"job_items", id}));
  const std::string after = AfterFromCursor(parameters, identity);
  const int limit = PageLimit(parameters);
  std::uint64_t first = 0;
  for (const char digit : after) {
    if (digit < '0' || digit > '9' || first > kMostBulkItems) ThrowInvalidCursor();
    first = first * 10 + static_cast<std::uint64_t>(digit - '0');
  }
  const auto texts = service.jobs->rows().JobItems(id, first, limit + 1);
  Json items = Json::array();
  for (std::size_t i = 0; i < texts.size() && i < static_cast<std::size_t>(limit); ++i) {
    Json item = Json::parse(texts[i], nullptr, /*allow_exceptions=*/false);
    if (item.is_object()) items.push_back(std::move(item));
  }
  const bool more = texts.size() > static_cast<std::size_t>(limit);
  const std::string next = std::to_string(first + static_cast<std::uint64_t>(limit));
  return JsonResponse({{"items", std::move(items)},
                       {"next", more ? Json(MakeCursor(identity, next)) : Json(nullptr)}});
}

}  // namespace

void AddJobRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "jobs.list",
       .method = "GET",
       .pattern = "/v1/jobs",
       .summary = "Background jobs, newest first; backups and imports of folders for admins",
       .answers = {{200, "the jobs", "JobList"}},
       .example = R"(curl "$PLIANT/v1/jobs")",
       .handler = [&service](const Request& request, const Parameters&) {
         Json items = Json::array();
         for (const JobStatus& job : service.jobs->List()) {
           if (MaySee(request.caller, job)) items.push_back(JobJson(job));
         }
         return JsonResponse({{"jobs", items}});
       }});
  routes.push_back({.name = "jobs.get",
                    .method = "GET",
                    .pattern = "/v1/jobs/{id}",
                    .summary = "How far a job is; with `wait`, as soon as it has ended",
                    .parameters = {Parameter("wait", "longest time in seconds to wait for its end")
                                       .Number(0, kLongestWaitS)
                                       .Default("0")},
                    .answers = {{200, "the job", "Job"}},
                    .codes = {"job_not_found"},
                    .example = R"(curl "$PLIANT/v1/jobs/$JOB?wait=10")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return JobAnswer(*service.jobs, request, parameters);
                    }});
  routes.push_back({.name = "jobs.items",
                    .method = "GET",
                    .pattern = "/v1/jobs/{id}/items",
                    .summary = "What became of each item of a job, page by page",
                    .parameters = {CursorParameter(), LimitParameter()},
                    .answers = {{200, "a page; empty for jobs without items", "JobItems"}},
                    .codes = {"job_not_found"},
                    .example = R"(curl "$PLIANT/v1/jobs/$JOB/items")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Items(service, request, parameters);
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
                      const JobStatus job = JobOf(*service.jobs, request);
                      return JsonResponse(JobJson(service.jobs->Cancel(job.id)), 202);
                    }});
}

}  // namespace pliant::server
