// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a server keeps in the database beside the images: API keys, jobs, requests. It has
// connections of its own, so that it works before an Engine has loaded its index, and beside one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
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
  std::string owner;             // ServiceStore::Owner() of the server that does it
  bool cancel = false;           // somebody asked for its end; SaveJob does not write it
};

// A request that its client may send again when it does not know what became of it.
struct RepeatableRequest {
  std::string caller;       // id of the API key; empty = none
  std::string name;         // that the client gave it
  std::string fingerprint;  // SHA-256 of what it asks for, 64 hex digits
};

struct RequestState {
  enum Kind {
    kBegun,     // by this call: whoever made it does the request, and ends it
    kRunning,   // another process that lives is doing it
    kAnswered,  // with `answer`
    kOther,     // another request has the name
  };
  Kind kind = kBegun;
  std::string answer;
};

class Access;

// Thread-safe. Every method throws what a database throws: kUnavailable, kNoSpace, kReadOnly,
// kCorrupt. OpenServiceStore (open_store.h) makes one.
class ServiceStore {
 public:
  // The database, opened for this.
  explicit ServiceStore(std::unique_ptr<Access> access);
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

  // The name under which this process has jobs; others can ask whether it still lives. Where a
  // process is known by a file, it is made by the first call.
  const std::string& Owner();
  bool Lives(const std::string& owner);

  std::vector<JobRecord> Jobs();  // oldest first
  // New, or in place of the one with its id; false = that is by now another owner's, and stays.
  bool SaveJob(const JobRecord& job);
  // A new job, with what it works on: kept until the job is saved as one that has ended.
  void AddJob(const JobRecord& job, std::span<const std::uint8_t> input);
  // Nothing where there is none.
  std::optional<std::vector<std::uint8_t>> JobInput(const std::string& id);
  // What a job says of each of its items, by their numbers from 0, as texts; forgotten with the
  // job. Add: those that follow `first`, in place of what is there.
  void AddJobItems(const std::string& id, std::uint64_t first,
                   const std::vector<std::string>& items);
  std::vector<std::string> JobItems(const std::string& id, std::uint64_t first, int limit);
  // New, unless a job of its kind in its collection has not ended, whoever does that; false = so it
  // is, and nothing was written.
  bool AddOnlyJob(const JobRecord& job);
  // Makes a job that has not ended this process's own; false = `from` does not have it any more.
  bool TakeJob(const std::string& id, const std::string& from);
  void RequestCancel(const std::string& id);
  void KeepNewestJobs(std::size_t count);  // forgets older ones that have ended

  // Requests that may be sent again, remembered for a day. What a process began that no longer
  // lives, or this one without ending it, is begun anew: the caller knows what it is doing.
  RequestState BeginRequest(const RepeatableRequest& request);
  // nullopt = it failed, and is forgotten: it can be tried again.
  void EndRequest(const RepeatableRequest& request, const std::optional<std::string>& answer);

 private:
  const std::unique_ptr<Access> access_;
};

}  // namespace pliant
