// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Background jobs.
#include <algorithm>
#include <chrono>

#include "descriptor/base/strings.h"
#include "server/routes/answers.h"
#include "server/routes/lists.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

constexpr double kLongestWaitS = 60;

// Admins start backups and imports of folders, and their records name files of the server. Other
// callers do not see them.
bool MaySee(const Caller& caller, const JobStatus& job) {
  return caller.scope >= Scope::kAdmin || (job.kind != "backup" && job.kind != "import");
}

// The job that the {id} of the path names. Throws ProblemError "job_not_found".
JobStatus JobOf(const JobStore& jobs, const Request& request) {
  JobStatus job = jobs.Get(request.captures.at("id"));
  if (!MaySee(request.caller, job)) ThrowJobNotFound();
  return job;
}

// A cursor holds the id of the last job of its page.
Response List(Service& service, const Request& request, const Parameters& parameters) {
  const auto state = parameters.Text("state");
  const auto collection = parameters.Text("collection");
  const std::string identity =
      ToText(Json::array({"jobs", state.value_or(""), collection.value_or("")}));
  const std::string after = AfterFromCursor(parameters, identity);
  const auto limit = parameters.Value<std::size_t>("limit");
  const std::vector<JobStatus> jobs = service.jobs->List();
  auto job = jobs.begin();
  if (!after.empty()) {
    job = std::find_if(job, jobs.end(), [&](const JobStatus& one) { return one.id == after; });
    if (job == jobs.end()) ThrowInvalidCursor();
    ++job;
  }
  Json items = Json::array();
  std::optional<std::string> next;
  for (; job != jobs.end() && !next; ++job) {
    const bool wanted = MaySee(request.caller, *job) &&
                        (!state || JobStateName(job->state) == *state) &&
                        (!collection || job->collection == *collection);
    if (wanted && items.size() == limit) next = items.back()["id"].get<std::string>();
    if (wanted && !next) items.push_back(JobJson(*job));
  }
  return PageResponse(request, {{"jobs", std::move(items)}, {"next", CursorJson(identity, next)}});
}

// The job as it is, or, with `wait`, as soon as it has ended.
Response Get(Service& service, const Request& request, const Parameters& parameters) {
  JobStore& jobs = *service.jobs;
  const JobStatus job = JobOf(jobs, request);
  const std::chrono::duration<double> patience(parameters.Value<double>("wait"));
  if (patience.count() == 0 || request.waited || !IsActive(job.state)) {
    return JsonResponse(JobJson(job));
  }
  return {.wait = Wait{std::chrono::steady_clock::now() +
                           std::chrono::ceil<std::chrono::milliseconds>(patience),
                       [&jobs, id = job.id](JobWaiters::Wake wake) {
                         return jobs.WhenEnded(id, std::move(wake));
                       }}};
}

Response Items(Service& service, const Request& request, const Parameters& parameters) {
  const std::string id = JobOf(*service.jobs, request).id;
  const std::string identity = ToText(Json::array({"job_items", id}));
  const std::string after = AfterFromCursor(parameters, identity);
  const auto limit = parameters.Value<std::size_t>("limit");
  const auto first = NumberOf<std::uint32_t>(after.empty() ? "0" : after);
  if (!first) ThrowInvalidCursor();
  std::vector<std::string> texts =
      service.jobs->rows().JobItems(id, *first, static_cast<int>(limit) + 1);
  std::optional<std::string> next;
  if (texts.size() > limit) {
    texts.resize(limit);
    next = std::to_string(*first + limit);
  }
  Json items = Json::array();
  for (const std::string& text : texts) {
    Json item = Json::parse(text, nullptr, /*allow_exceptions=*/false);
    if (item.is_object()) items.push_back(std::move(item));
  }
  return PageResponse(request, {{"items", std::move(items)}, {"next", CursorJson(identity, next)}});
}

Response Cancel(Service& service, const Request& request, const Parameters&) {
  const JobStatus job = JobOf(*service.jobs, request);
  return JsonResponse(JobJson(service.jobs->Cancel(job.id)), 202);
}

}  // namespace

void AddJobRoutes(RouteTable& table) {
  table.Add("GET /v1/jobs", "jobs.list", List)
      .Summary("List background jobs, newest first; only admins see backups and folder imports")
      .Takes({Parameter("collection", "only jobs of the collection of this name"),
              Parameter("state", "only jobs in this state")
                  .Choice({"queued", "running", "done", "failed", "cancelled"}),
              CursorParameter(), LimitParameter()})
      .Answers(200, "a page of jobs", "JobList");
  table.Add("GET /v1/jobs/{id}", "jobs.get", Get)
      .Summary("Get the state of a job; with `wait`, wait until the job has ended")
      .Takes({Parameter("wait", "seconds to wait for the end of the job")
                  .Number(0, kLongestWaitS)
                  .Default("0")})
      .Answers(200, "the job", "Job")
      .Example(R"(curl "$PLIANT/v1/jobs/$JOB?wait=10")");
  table.Add("GET /v1/jobs/{id}/items", "jobs.items", Items)
      .Summary("List the results of each item of a job, page by page")
      .Takes({CursorParameter(), LimitParameter()})
      .Answers(200, "a page; empty for jobs without items", "JobItems");
  table.Add("DELETE /v1/jobs/{id}", "jobs.cancel", Cancel)
      .Summary("Cancel a job; a job that has ended does not change")
      .Answers(202, "the job; it ends soon if it has not ended yet", "Job");
}

}  // namespace pliant::server
