// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/answers.h"

#include "index/json/record_json.h"

namespace pliant::server {

namespace {

Json TimeOrNull(std::int64_t unix_ms) {
  return unix_ms == 0 ? Json(nullptr) : Json(IsoTime(unix_ms));
}

}  // namespace

Response JsonResponse(const Json& json, int status) {
  Response response;
  response.status = status;
  response.content_type = "application/json";
  response.body = ToText(json);
  response.headers.emplace_back("Cache-Control", "no-store");
  return response;
}

Json JobJson(const JobStatus& job) {
  Json json = {{"id", job.id},
               {"kind", job.kind},
               {"collection", job.collection},
               {"parameters", job.parameters},
               {"state", JobStateName(job.state)},
               {"done", job.done},
               {"total", job.total},
               {"failed", job.failed},
               {"attempts", job.attempts},
               {"created_at", IsoTime(job.created_ms)},
               {"finished_at", TimeOrNull(job.finished_ms)}};
  if (!job.result.empty()) json["result"] = job.result;
  for (const SkippedItem& item : job.skipped) {
    json["skipped"].push_back({{"item", item.item}, {"code", item.code}, {"reason", item.reason}});
  }
  if (job.problem) json["problem"] = ProblemSummary(*job.problem);
  return json;
}

Response JobResponse(const JobStatus& job) {
  Response response = JsonResponse(JobJson(job), 202);
  response.headers.emplace_back("Location", "/v1/jobs/" + job.id);
  return response;
}

Json ProblemSummary(const Problem& problem) {
  Json json = {{"code", problem.code}, {"detail", problem.detail}};
  if (!problem.parameter.empty()) json["parameter"] = problem.parameter;
  return json;
}

}  // namespace pliant::server
