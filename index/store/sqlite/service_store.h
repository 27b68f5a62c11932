// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a server keeps in the database file beside the pictures: API keys and jobs. It has
// connections of its own, so that it works before an Engine has loaded its index, and beside one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace pliant {

struct ApiKeyRecord {
  std::string id;     // public: it is in the key and in logs
  std::string name;   // for people
  std::string scope;  // "read", "write" or "admin"
  std::string hash;   // SHA-256 of the whole key, 64 hex digits
  std::int64_t created_ms = 0;
  std::int64_t revoked_ms = 0;  // 0 = it works
};

struct JobRecord {
  std::string id;
  std::string kind;
  std::string collection;
  std::string parameters = "{}";  // JSON: what is needed to begin again
  std::string state;              // "queued", "running", "done", "failed" or "cancelled"
  double done = 0;                // of `total`
  double total = 1;
  std::uint64_t failed = 0;
  int attempts = 0;  // times it was begun
  std::string result;
  std::string report = "{}";  // JSON
  std::int64_t created_ms = 0;
  std::int64_t finished_ms = 0;  // 0 = not yet
};

// Thread-safe. Every method throws what a database throws: kUnavailable, kNoSpace, kCorrupt.
class ServiceStore {
 public:
  // The database must exist; an older one is brought to the newest schema. Throws kNotFound
  // "database_not_found" and what Engine's constructor throws for files that are no database.
  explicit ServiceStore(const std::filesystem::path& database);
  ~ServiceStore();
  ServiceStore(const ServiceStore&) = delete;
  ServiceStore& operator=(const ServiceStore&) = delete;

  // Changes whenever any process or thread has committed anything: then lists may differ.
  std::int64_t Version();

  std::vector<ApiKeyRecord> Keys();  // oldest first, with those that are revoked
  void AddKey(const ApiKeyRecord& key);
  // By id, or by a name that one working key has; false = there is none. Throws kConflict
  // "key_ambiguous" when several have that name.
  bool RevokeKey(const std::string& id_or_name);
  std::uint64_t ForgetRevokedKeys();  // how many

  std::vector<JobRecord> Jobs();           // oldest first
  void SaveJob(const JobRecord& job);      // new, or in place of the one with its id
  void KeepNewestJobs(std::size_t count);  // forgets older ones that have ended

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant
