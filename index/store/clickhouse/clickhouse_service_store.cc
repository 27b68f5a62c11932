// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/clickhouse_service_store.h"

#include <algorithm>
#include <array>
#include <random>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "index/store/clickhouse/query.h"

namespace pliant::clickhouse {
namespace {

using Json = nlohmann::json;

constexpr const char* kKey = "api_key";
constexpr const char* kJob = "job";
constexpr const char* kInput = "job_input";
constexpr const char* kItem = "job_item";
constexpr const char* kRequest = "request";
constexpr std::chrono::milliseconds kVersionHolds{300};
constexpr std::int64_t kRememberedMs = std::int64_t{24} * 60 * 60 * 1000;

std::string Text(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

RegistryRow Gone(const std::string& kind, const std::string& name) {
  return {kind, name, true, "{}"};
}

ApiKeyRecord ToKey(const std::string& body) {
  const Json json = Json::parse(body);
  ApiKeyRecord key;
  key.id = json.at("id").get<std::string>();
  key.name = json.at("name").get<std::string>();
  key.scope = json.at("scope").get<std::string>();
  key.hash = json.at("hash").get<std::string>();
  key.created_ms = json.at("created_ms").get<std::int64_t>();
  key.revoked_ms = json.at("revoked_ms").get<std::int64_t>();
  return key;
}

RegistryRow ToRow(const ApiKeyRecord& key) {
  return {kKey, key.id, false,
          Text({{"id", key.id},
                {"name", key.name},
                {"scope", key.scope},
                {"hash", key.hash},
                {"created_ms", key.created_ms},
                {"revoked_ms", key.revoked_ms}})};
}

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
          Text({{"id", job.id},
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

std::string RequestName(const RepeatableRequest& request) {
  return request.caller + "/" + request.name;
}

std::string RandomName() {
  std::random_device random;
  std::array<std::uint8_t, 16> bytes;
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return ToHex(bytes);
}

}  // namespace

std::vector<ClickhouseServiceStore::Entry> ClickhouseServiceStore::Entries(const std::string& kind,
                                                                           const std::string& from,
                                                                           int limit) {
  std::string statement =
      "SELECT name, argMax(body, version) AS text, argMax(deleted, version) AS gone FROM registry "
      "WHERE kind = " +
      Literal(kind) + (from.empty() ? "" : " AND name >= " + Literal(from)) +
      " GROUP BY name HAVING gone = 0 ORDER BY name";
  if (limit > 0) statement += " LIMIT " + std::to_string(limit);
  const NativeBlock rows = access_.link.Read(
      ClusterLink::kHome, statement, {{"name", "String"}, {"text", "String"}, {"gone", "UInt8"}});
  std::vector<Entry> entries;
  for (std::size_t i = 0; i < rows.rows; ++i) {
    entries.push_back({Row(rows, i).Text(0), Row(rows, i).Text(1)});
  }
  return entries;
}

std::optional<std::string> ClickhouseServiceStore::Find(const std::string& kind,
                                                        const std::string& name) {
  std::vector<Entry> entries = Entries(kind, name, 1);
  if (entries.empty() || entries[0].name != name) return std::nullopt;
  return std::move(entries[0].body);
}

void ClickhouseServiceStore::Write(const std::function<void(Change& change)>& work) {
  access_.commits.RunAtOpening(work, /*alone=*/true);
  const std::lock_guard lock(mutex_);
  version_at_ = {};  // what this server has changed, it sees at once
}

// Every request asks: what another server has changed is seen after this time at the latest.
std::int64_t ClickhouseServiceStore::Version() {
  {
    const std::lock_guard lock(mutex_);
    if (Clock::now() - version_at_ < kVersionHolds) return version_;
  }
  const NativeBlock rows = access_.link.Read(
      ClusterLink::kHome, "SELECT max(version) AS newest FROM registry", {{"newest", "UInt64"}});
  const std::lock_guard lock(mutex_);
  version_ = rows.rows == 0 ? 0 : Row(rows, 0).Signed(0);
  version_at_ = Clock::now();
  return version_;
}

std::vector<ApiKeyRecord> ClickhouseServiceStore::Keys() {
  std::vector<ApiKeyRecord> keys;
  for (const Entry& entry : Entries(kKey)) keys.push_back(ToKey(entry.body));
  std::stable_sort(keys.begin(), keys.end(), [](const ApiKeyRecord& a, const ApiKeyRecord& b) {
    return a.created_ms < b.created_ms;
  });
  return keys;
}

void ClickhouseServiceStore::AddKey(const ApiKeyRecord& key) {
  Write([&](Change& change) { change.Set(ToRow(key)); });
}

bool ClickhouseServiceStore::RevokeKey(const std::string& id_or_name) {
  bool revoked = false;
  Write([&](Change& change) {
    std::vector<ApiKeyRecord> named;
    for (ApiKeyRecord& key : Keys()) {
      if (key.revoked_ms != 0) continue;
      if (key.id == id_or_name) {
        named = {std::move(key)};
        break;
      }
      if (key.name == id_or_name) named.push_back(std::move(key));
    }
    if (named.size() > 1) {
      throw Error(
          ErrorCode::kConflict, "key_ambiguous",
          "several keys are called \"" + id_or_name + "\"; name the id of the one to revoke");
    }
    revoked = !named.empty();
    if (!revoked) return;
    named.front().revoked_ms = NowMs();
    change.Set(ToRow(named.front()));
  });
  return revoked;
}

std::uint64_t ClickhouseServiceStore::ForgetRevokedKeys() {
  std::uint64_t forgotten = 0;
  Write([&](Change& change) {
    for (const ApiKeyRecord& key : Keys()) {
      if (key.revoked_ms == 0) continue;
      change.Set(Gone(kKey, key.id));
      ++forgotten;
    }
  });
  return forgotten;
}

const std::string& ClickhouseServiceStore::Owner() {
  const std::lock_guard lock(mutex_);
  if (owner_.empty()) owner_ = RandomName();
  // After a lost session the name is the same: nobody else has it.
  if (!lease_ || !lease_->held()) lease_ = access_.keeper->TryLease("servers/" + owner_, "");
  return owner_;
}

bool ClickhouseServiceStore::Lives(const std::string& owner) {
  return !owner.empty() && access_.keeper->Read("servers/" + owner).has_value();
}

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
  if (HasEnded(job) && Find(kInput, job.id)) change.Set(Gone(kInput, job.id));
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
      change.Set(Gone(kJob, jobs[i].id));
      for (const Entry& item : Entries(kItem, jobs[i].id + "/")) {
        if (!item.name.starts_with(jobs[i].id + "/")) break;
        change.Set(Gone(kItem, item.name));
      }
    }
  });
}

RequestState ClickhouseServiceStore::BeginRequest(const RepeatableRequest& request) {
  const std::string self = Owner();
  const std::string name = RequestName(request);
  RequestState state;
  Write([&](Change& change) {
    const std::int64_t now = NowMs();
    if (const auto body = Find(kRequest, name)) {
      const Json json = Json::parse(*body);
      const bool remembered = json.at("begun_ms").get<std::int64_t>() >= now - kRememberedMs;
      if (remembered && json.at("fingerprint") != request.fingerprint) {
        state = {RequestState::kOther, {}};
        return;
      }
      if (remembered && json.at("answer").is_string()) {
        state = {RequestState::kAnswered, json.at("answer").get<std::string>()};
        return;
      }
      const auto owner = json.at("owner").get<std::string>();
      if (remembered && owner != self && Lives(owner)) {
        state = {RequestState::kRunning, {}};
        return;
      }
    }
    change.Set({kRequest, name, false,
                Text({{"fingerprint", request.fingerprint},
                      {"owner", self},
                      {"answer", nullptr},
                      {"begun_ms", now}})});
    state = {RequestState::kBegun, {}};
  });
  return state;
}

void ClickhouseServiceStore::EndRequest(const RepeatableRequest& request,
                                        const std::optional<std::string>& answer) {
  const std::string self = Owner();
  const std::string name = RequestName(request);
  Write([&](Change& change) {
    const auto body = Find(kRequest, name);
    if (!body) return;
    Json json = Json::parse(*body);
    if (json.at("owner") != self) return;
    if (!answer) {
      change.Set(Gone(kRequest, name));
      return;
    }
    json["answer"] = *answer;
    change.Set({kRequest, name, false, Text(json)});
  });
}

std::unique_ptr<ServiceStore> OpenClickhouseServiceStore(const std::string& url) {
  return std::make_unique<ClickhouseServiceStore>(url);
}

}  // namespace pliant::clickhouse
