// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Jobs of a cluster.
#include <algorithm>

#include <nlohmann/json.hpp>

#include "index/store/clickhouse/clickhouse_service_store.h"
#include "index/store/clickhouse/registry_text.h"

namespace pliant::clickhouse {
namespace {

using Json = nlohmann::json;

constexpr const char* kJob = "job";
constexpr const char* kInput = "job_input";
constexpr const char* kItem = "job_item";

JobRecord ToJob(const std::string& body) {
  const Json json = Json::parse(body);
  JobRecord job;
  job.id = json.at("id").get<std::string>();
  job.kind = json.at("kind").get<std::string>();
  job.collection = json.at("collection").get<std::string>();
  job.parameters = json.at("parameters").get<std::string>();
  job.state = json.at("state").get<std::string>();
  job.done = json.at("done").get<double>();
  job.total = json.at("total").get<double>();
  job.failed = json.at("failed").get<std::uint64_t>();
  job.attempts = json.at("attempts").get<int>();
  job.result = json.at("result").get<std::string>();
  job.report = json.at("report").get<std::string>();
  job.created_ms = json.at("created_ms").get<std::int64_t>();
  job.finished_ms = json.at("finished_ms").get<std::int64_t>();
  job.owner = json.at("owner").get<std::string>();
  job.cancel = json.at("cancel").get<bool>();
  return job;
}

RegistryRow ToRow(const JobRecord& job) {
  return {kJob, job.id, false,
          RegistryText({{"id", job.id},
                        {"kind", job.kind},
                        {"collection", job.collection},
                        {"parameters", job.parameters},
                        {"state", job.state},
                        {"done", job.done},
                        {"total", job.total},
                        {"failed", job.failed},
                        {"attempts", job.attempts},
                        {"result", job.result},
                        {"report", job.report},
                        {"created_ms", job.created_ms},
                        {"finished_ms", job.finished_ms},
                        {"owner", job.owner},
                        {"cancel", job.cancel}})};
}

bool HasEnded(const JobRecord& job) { return job.state != "queued" && job.state != "running"; }

std::string ItemName(const std::string& job, std::uint64_t number) {
  const std::string digits = std::to_string(number);
  return job + "/" + std::string(12 - std::min<std::size_t>(12, digits.size()), '0') + digits;
}

}  // namespace

std::vector<JobRecord> ClickhouseServiceStore::Jobs() {
  std::vector<JobRecord> jobs;
  for (const Entry& entry : Entries(kJob)) jobs.push_back(ToJob(entry.body));
  std::stable_sort(jobs.begin(), jobs.end(), [](const JobRecord& a, const JobRecord& b) {
    return a.created_ms < b.created_ms;
  });
  return jobs;
}

bool ClickhouseServiceStore::Save(Change& change, const JobRecord& job) {
  JobRecord saved = job;
  if (const auto body = Find(kJob, job.id)) {
    const JobRecord before = ToJob(*body);
    if (before.owner != job.owner) return false;
    saved.cancel = before.cancel;
  }
  change.Set(ToRow(saved));
  // Nobody begins it again.
  if (HasEnded(job) && Find(kInput, job.id)) change.Set(RegistryGone(kInput, job.id));
  return true;
}

bool ClickhouseServiceStore::SaveJob(const JobRecord& job) {
  bool saved = false;
  Write([&](Change& change) { saved = Save(change, job); });
  return saved;
}

void ClickhouseServiceStore::AddJob(const JobRecord& job, std::span<const std::uint8_t> input) {
  Write([&](Change& change) {
    Save(change, job);
    change.Set({kInput, job.id, false, std::string(input.begin(), input.end())});
  });
}

std::optional<std::vector<std::uint8_t>> ClickhouseServiceStore::JobInput(const std::string& id) {
  const auto body = Find(kInput, id);
  if (!body) return std::nullopt;
  return std::vector<std::uint8_t>(body->begin(), body->end());
}

void ClickhouseServiceStore::AddJobItems(const std::string& id, std::uint64_t first,
                                         const std::vector<std::string>& items) {
  Write([&](Change& change) {
    for (std::size_t i = 0; i < items.size(); ++i) {
      change.Set({kItem, ItemName(id, first + i), false, items[i]});
    }
  });
}

std::vector<std::string> ClickhouseServiceStore::JobItems(const std::string& id,
                                                          std::uint64_t first, int limit) {
  std::vector<std::string> items;
  for (Entry& entry : Entries(kItem, ItemName(id, first), limit)) {
    if (!entry.name.starts_with(id + "/")) break;
    items.push_back(std::move(entry.body));
  }
  return items;
}

bool ClickhouseServiceStore::AddOnlyJob(const JobRecord& job) {
  bool added = false;
  Write([&](Change& change) {
    const std::vector<JobRecord> jobs = Jobs();
    added = std::none_of(jobs.begin(), jobs.end(), [&](const JobRecord& other) {
      return other.kind == job.kind && other.collection == job.collection && !HasEnded(other);
    });
    if (added) added = Save(change, job);
  });
  return added;
}

bool ClickhouseServiceStore::TakeJob(const std::string& id, const std::string& from) {
  const std::string to = Owner();
  bool taken = false;
  Write([&](Change& change) {
    const auto body = Find(kJob, id);
    if (!body) return;
    JobRecord job = ToJob(*body);
    taken = job.owner == from && !HasEnded(job);
    if (!taken) return;
    job.owner = to;
    change.Set(ToRow(job));
  });
  return taken;
}

void ClickhouseServiceStore::RequestCancel(const std::string& id) {
  Write([&](Change& change) {
    const auto body = Find(kJob, id);
    if (!body) return;
    JobRecord job = ToJob(*body);
    if (HasEnded(job)) return;
    job.cancel = true;
    change.Set(ToRow(job));
  });
}

void ClickhouseServiceStore::KeepNewestJobs(std::size_t count) {
  const std::vector<JobRecord> jobs = Jobs();
  if (jobs.size() <= count) return;
  const std::size_t old = jobs.size() - count;
  Write([&](Change& change) {
    for (std::size_t i = 0; i < old; ++i) {
      if (!HasEnded(jobs[i])) continue;
      change.Set(RegistryGone(kJob, jobs[i].id));
      for (const Entry& item : Entries(kItem, jobs[i].id + "/")) {
        if (!item.name.starts_with(jobs[i].id + "/")) break;
        change.Set(RegistryGone(kItem, item.name));
      }
    }
  });
}

}  // namespace pliant::clickhouse
