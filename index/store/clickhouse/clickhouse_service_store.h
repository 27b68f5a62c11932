// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What servers keep in a cluster beside the pictures: rows of the registry. A server is known by a
// lease of the Keeper. Private to store/clickhouse.
#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "index/store/clickhouse/clickhouse_store.h"
#include "index/store/service_store.h"

namespace pliant::clickhouse {

class ClickhouseServiceStore : public ServiceStore {
 public:
  explicit ClickhouseServiceStore(const std::string& url) : access_(url) {}

  std::int64_t Version() override;

  std::vector<ApiKeyRecord> Keys() override;
  void AddKey(const ApiKeyRecord& key) override;
  bool RevokeKey(const std::string& id_or_name) override;
  std::uint64_t ForgetRevokedKeys() override;

  const std::string& Owner() override;
  bool Lives(const std::string& owner) override;

  std::vector<JobRecord> Jobs() override;
  bool SaveJob(const JobRecord& job) override;
  void AddJob(const JobRecord& job, std::span<const std::uint8_t> input) override;
  std::optional<std::vector<std::uint8_t>> JobInput(const std::string& id) override;
  void AddJobItems(const std::string& id, std::uint64_t first,
                   const std::vector<std::string>& items) override;
  std::vector<std::string> JobItems(const std::string& id, std::uint64_t first, int limit) override;
  bool AddOnlyJob(const JobRecord& job) override;
  bool TakeJob(const std::string& id, const std::string& from) override;
  void RequestCancel(const std::string& id) override;
  void KeepNewestJobs(std::size_t count) override;

  RequestState BeginRequest(const RepeatableRequest& request) override;
  void EndRequest(const RepeatableRequest& request,
                  const std::optional<std::string>& answer) override;

 private:
  using Clock = std::chrono::steady_clock;
  struct Entry {
    std::string name;
    std::string body;
  };
  // Of what is there, in the order of their names; `from`: with names from there on.
  std::vector<Entry> Entries(const std::string& kind, const std::string& from = {}, int limit = 0);
  std::optional<std::string> Find(const std::string& kind, const std::string& name);
  // Under the cluster's lock for writing, so that what `work` reads is still so when it is written.
  void Write(const std::function<void(Change& change)>& work);
  bool Save(Change& change, const JobRecord& job);
  bool HoldsWhileGone() const;

  ClusterAccess access_;
  std::mutex mutex_;  // guards the rest
  std::string owner_;
  std::unique_ptr<KeeperLease> lease_;
  std::int64_t version_ = 0;
  Clock::time_point version_at_;
  Clock::time_point read_at_;  // when the cluster last said which version it is
};

}  // namespace pliant::clickhouse
