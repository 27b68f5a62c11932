// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/job_record.h"

#include <chrono>

#include "index/json/json.h"

namespace pliant::server {

JobRecord ToRecord(const JobStatus& status) {
  JobRecord record;
  record.id = status.id;
  record.kind = status.kind;
  record.collection = status.collection;
  record.parameters = ToText(status.parameters);
  record.state = JobStateName(status.state);
  record.done = status.done;
  record.total = status.total;
  record.failed = status.failed;
  record.attempts = status.attempts;
  record.result = status.result;
  record.created_ms = status.created_ms;
  record.finished_ms = status.finished_ms;
  Json report = Json::object();
  if (status.problem) {
    report["problem"] = {{"status", status.problem->status},
                         {"code", status.problem->code},
                         {"parameter", status.problem->parameter},
                         {"detail", status.problem->detail}};
  }
  if (status.cancelled) report["cancelled"] = true;
  for (const SkippedItem& item : status.skipped) {
    report["skipped"].push_back({item.item, item.code, item.reason});
  }
  record.report = ToText(report);
  return record;
}

JobStatus FromRecord(const JobRecord& record) {
  JobStatus status;
  status.id = record.id;
  status.kind = record.kind;
  status.collection = record.collection;
  const Json parameters = Json::parse(record.parameters, nullptr, /*allow_exceptions=*/false);
  if (parameters.is_object()) status.parameters = parameters;
  for (const JobState state : {JobState::kQueued, JobState::kRunning, JobState::kDone,
                               JobState::kFailed, JobState::kCancelled}) {
    if (record.state == JobStateName(state)) status.state = state;
  }
  status.done = record.done;
  status.total = record.total;
  status.failed = record.failed;
  status.attempts = record.attempts;
  status.result = record.result;
  status.created_ms = record.created_ms;
  status.finished_ms = record.finished_ms;
  const Json report = Json::parse(record.report, nullptr, /*allow_exceptions=*/false);
  if (!report.is_object()) return status;
  status.cancelled = report.value("cancelled", false);
  if (report.contains("problem")) {
    const Json& problem = report["problem"];
    status.problem = Problem{.status = problem.value("status", 500),
                             .code = problem.value("code", "internal"),
                             .detail = problem.value("detail", ""),
                             .parameter = problem.value("parameter", "")};
  }
  for (const Json& item : report.value("skipped", Json::array())) {
    status.skipped.push_back({item.at(0), item.at(1), item.at(2)});
  }
  return status;
}

std::int64_t UnixMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace pliant::server
