// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/answers.h"

#include "descriptor/base/sha256.h"
#include "server/http/conditions.h"

namespace pliant::server {

namespace {

constexpr std::size_t kEtagDigits = 32;

std::string EtagOfText(const std::string& text) {
  return '"' + Sha256Hex(text).substr(0, kEtagDigits) + '"';
}

Response CachedAs(const char* cache_control, const Json& json, int status = 200) {
  return {.status = status,
          .content_type = "application/json",
          .body = ToText(json),
          .headers = {{"Cache-Control", cache_control}}};
}

Response WithEtag(Response response) {
  response.headers.emplace_back("ETag", EtagOfText(response.body));
  return response;
}

}  // namespace

std::string EtagOf(const Json& record) { return EtagOfText(ToText(record)); }

Response JsonResponse(const Json& json, int status, const std::string& location) {
  Response response = CachedAs("no-store", json, status);
  if (!location.empty()) response.headers.emplace_back("Location", location);
  return response;
}

Response RecordResponse(const Json& record, int status) {
  return WithEtag(JsonResponse(record, status));
}

Response TaggedResponse(const Json& json) { return WithEtag(CachedAs("private, no-cache", json)); }

void CheckIfMatch(const Request& request, const Json& record) {
  if (IfMatchHolds(request, EtagOf(record))) return;
  throw ProblemError("precondition_failed",
                     "Precondition failed: the resource does not match If-Match. Read it again.");
}

void CheckConditionsOf(const Request& request, const Json& record_or_null) {
  if (record_or_null.is_null()) {
    if (!request.headers.contains("If-Match")) return;
    throw ProblemError("precondition_failed", "Precondition failed: the resource does not exist.");
  }
  CheckIfMatch(request, record_or_null);
  if (!NamedByIfNoneMatch(request, EtagOf(record_or_null)).empty()) {
    throw ProblemError("precondition_failed", "Precondition failed: the resource already exists.");
  }
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
               {"system_files", job.system_files},
               {"attempts", job.attempts},
               {"created_at", IsoTime(job.created_ms)},
               {"finished_at", nullptr}};
  if (job.finished_ms != 0) json["finished_at"] = IsoTime(job.finished_ms);
  if (!job.result.empty()) json["result"] = job.result;
  for (const SkippedFile& item : job.skipped) {
    json["skipped"].push_back({{"item", item.file}, {"code", item.code}, {"reason", item.reason}});
  }
  if (job.problem) json["problem"] = ProblemSummary(*job.problem);
  return json;
}

Response JobResponse(const JobStatus& job) {
  return JsonResponse(JobJson(job), 202, "/v1/jobs/" + job.id);
}

Json ProblemSummary(const Problem& problem) {
  Json json = {{"code", problem.code}, {"detail", problem.detail}};
  if (!problem.parameter.empty()) json["parameter"] = problem.parameter;
  return json;
}

}  // namespace pliant::server
