// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a server keeps in a database file beside the pictures. Private to store/sqlite.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <SQLiteCpp/Transaction.h>

#include "index/files/process_lock.h"
#include "index/store/service_store.h"
#include "index/store/sqlite/connection.h"
#include "index/store/sqlite/sqlite_error.h"

namespace pliant {

class SqliteServiceStore : public ServiceStore {
 public:
  explicit SqliteServiceStore(const std::filesystem::path& path);

  std::int64_t Version() override;
  const std::string& Owner() override;
  bool Lives(const std::string& owner) override;
  std::vector<ApiKeyRecord> Keys() override;
  void AddKey(const ApiKeyRecord& key) override;
  bool RevokeKey(const std::string& id_or_name) override;
  std::uint64_t ForgetRevokedKeys() override;

  // sqlite_jobs.cc
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

  // sqlite_requests.cc
  RequestState BeginRequest(const RepeatableRequest& request) override;
  void EndRequest(const RepeatableRequest& request,
                  const std::optional<std::string>& answer) override;

 private:
  static bool Save(Connection& db, const JobRecord& job);  // within a transaction

  template <typename Work>
  auto Read(Work&& work) {
    return WithDatabaseErrors(path_, [&] {
      const std::lock_guard lock(reader_mutex_);
      return work(*reader_);
    });
  }

  template <typename Work>
  auto Write(Work&& work) {
    return WithDatabaseErrors(path_, [&] {
      const std::lock_guard lock(writer_mutex_);
      writer_->EndLeftOver();
      SQLite::Transaction transaction(writer_->database(), SQLite::TransactionBehavior::IMMEDIATE);
      auto result = work(*writer_);
      transaction.commit();
      return result;
    });
  }

  const std::filesystem::path path_;
  std::mutex lock_mutex_;            // guards lock_
  std::optional<ProcessLock> lock_;  // from the first Owner()
  std::mutex reader_mutex_;          // guards reader_
  std::unique_ptr<Connection> reader_;
  std::mutex writer_mutex_;  // guards writer_
  std::unique_ptr<Connection> writer_;
};

}  // namespace pliant
