// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a server keeps in the database beside the pictures: API keys and jobs. It has connections of
// its own, so that it works before an Engine has loaded its index, and beside one.
#pragma once

#include <cstddef>
#include <cstdint>
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

// Thread-safe. Every method throws what a database throws: kUnavailable, kNoSpace, kReadOnly,
// kCorrupt. OpenServiceStore (open_store.h) makes one.
class ServiceStore {
 public:
  virtual ~ServiceStore() = default;

  // Changes whenever any process or thread has committed anything: then lists may differ.
  virtual std::int64_t Version() = 0;

  virtual std::vector<ApiKeyRecord> Keys() = 0;  // oldest first, with those that are revoked
  virtual void AddKey(const ApiKeyRecord& key) = 0;
  // By id, or by a name that one working key has; false = there is none. Throws kConflict
  // "key_ambiguous" when several have that name.
  virtual bool RevokeKey(const std::string& id_or_name) = 0;
  virtual std::uint64_t ForgetRevokedKeys() = 0;  // how many

  virtual std::vector<JobRecord> Jobs() = 0;           // oldest first
  virtual void SaveJob(const JobRecord& job) = 0;      // new, or in place of the one with its id
  virtual void KeepNewestJobs(std::size_t count) = 0;  // forgets older ones that have ended
};

}  // namespace pliant
