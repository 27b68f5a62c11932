// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/job_record.h"

#include <algorithm>

#include "index/json/json.h"

namespace pliant::server {

namespace {

// What is written by another program, or damaged, may be of any type.
std::string TextOr(const Json& object, const char* key, const std::string& fallback) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : fallback;
}

Problem ReadProblem(const Json& json) {
  Problem problem{.code = TextOr(json, "code", "internal"),
                  .detail = TextOr(json, "detail", ""),
                  .parameter = TextOr(json, "parameter", "")};
  const auto status = json.find("status");
  if (status != json.end() && status->is_number_unsigned() && *status < 600) {
    problem.status = status->get<int>();
  }
  return problem;
}

bool IsSkippedItem(const Json& json) {
  return json.is_array() && json.size() == 3 &&
         std::all_of(json.begin(), json.end(), [](const Json& text) { return text.is_string(); });
}

}  // namespace

JobRecord ToRecord(const JobStatus& status, const std::string& owner) {
  JobRecord record;
  record.owner = owner;
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
  if (report.contains("problem")) status.problem = ReadProblem(report["problem"]);
  for (const Json& item : report.value("skipped", Json::array())) {
    if (IsSkippedItem(item)) status.skipped.push_back({item[0], item[1], item[2]});
  }
  return status;
}

}  // namespace pliant::server
