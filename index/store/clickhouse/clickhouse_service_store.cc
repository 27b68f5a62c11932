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
#include "index/store/clickhouse/registry_text.h"
#include "index/store/refusals.h"

namespace pliant::clickhouse {
namespace {

using Json = nlohmann::json;

constexpr const char* kKey = "api_key";
constexpr const char* kRequest = "request";
constexpr std::chrono::milliseconds kVersionHolds{300};
// While the shard of the keys is gone, nobody can change or revoke one; unless it is gone for this
// server alone, and so not for long.
constexpr std::chrono::minutes kVersionHoldsWhileGone{10};
constexpr std::int64_t kRememberedMs = std::int64_t{24} * 60 * 60 * 1000;

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
          RegistryText({{"id", key.id},
                        {"name", key.name},
                        {"scope", key.scope},
                        {"hash", key.hash},
                        {"created_ms", key.created_ms},
                        {"revoked_ms", key.revoked_ms}})};
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

// With mutex_ held.
bool ClickhouseServiceStore::HoldsWhileGone() const {
  return version_ != 0 && Clock::now() - read_at_ < kVersionHoldsWhileGone;
}

// Every request asks: what another server has changed is seen after this time at the latest.
std::int64_t ClickhouseServiceStore::Version() {
  {
    const std::lock_guard lock(mutex_);
    if (Clock::now() - version_at_ < kVersionHolds) return version_;
    const std::vector<std::size_t> gone = access_.link.Gone();
    if (!gone.empty() && gone.front() == ClusterLink::kHome && HoldsWhileGone()) return version_;
  }
  NativeBlock rows;
  try {
    rows = access_.link.Read(ClusterLink::kHome, "SELECT max(version) AS newest FROM registry",
                             {{"newest", "UInt64"}});
  } catch (const Error& error) {
    const std::lock_guard lock(mutex_);
    if (error.code() != ErrorCode::kUnavailable || !HoldsWhileGone()) throw;
    return version_;
  }
  const std::lock_guard lock(mutex_);
  read_at_ = Clock::now();
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
      throw refusals::KeyAmbiguous(id_or_name);
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
      change.Set(RegistryGone(kKey, key.id));
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
                RegistryText({{"fingerprint", request.fingerprint},
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
      change.Set(RegistryGone(kRequest, name));
      return;
    }
    json["answer"] = *answer;
    change.Set({kRequest, name, false, RegistryText(json)});
  });
}

std::unique_ptr<ServiceStore> OpenClickhouseServiceStore(const std::string& url) {
  return std::make_unique<ClickhouseServiceStore>(url);
}

}  // namespace pliant::clickhouse
