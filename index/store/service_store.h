// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The server's own records in the database: API keys, jobs, requests. It has separate connections,
// so that it works without an Engine and before an Engine has loaded its index.
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
  std::string id;     // public: part of the key, and in logs
  std::string name;   // for people
  std::string scope;  // "read", "write" or "admin"
  std::string hash;   // SHA-256 of the whole key, 64 hex digits
  std::int64_t created_ms = 0;
  std::int64_t revoked_ms = 0;  // 0 = valid
};

struct JobFields {
  std::string id = {};
  std::string kind = {};  // "train", "activate", "import", "backup"
  std::string collection = {};
  double done = 0;  // of `total`
  double total = 1;
  std::uint64_t failed = 0;  // items that could not be done
  int attempts = 0;          // number of starts
  std::string result = {};   // address of what was made; empty until it is done
  std::int64_t created_ms = 0;
  std::int64_t finished_ms = 0;  // 0 = not yet
};

// A job's row. The server's JobStatus has the meaning of the texts.
struct JobRecord : JobFields {
  std::string parameters = "{}";  // JSON: the data to start the job again
  std::string state = {};         // "queued", "running", "done", "failed" or "cancelled"
  std::string report = "{}";      // JSON
  std::string owner = {};         // ServiceStore::Owner() of the server that runs it
  bool cancel = false;            // its cancellation was requested; SaveJob does not write this
};

// A request that its client can send again when the outcome is unknown.
struct RepeatableRequest {
  std::string caller;       // id of the API key; empty = none
  std::string name;         // given by the client
  std::string fingerprint;  // SHA-256 of the request's content, 64 hex digits
};

struct RequestState {
  enum Kind {
    kBegun,     // by this call: the caller performs the request, and ends it
    kRunning,   // a living process performs it
    kAnswered,  // with `answer`
    kOther,     // a different request has the name
  };
  Kind kind = kBegun;
  std::string answer;
};

class Access;

// Thread-safe. Every method throws what a database throws: kUnavailable, kNoSpace, kReadOnly,
// kCorrupt. OpenServiceStore (open_store.h) makes one.
class ServiceStore {
 public:
  // The database, opened for this purpose.
  explicit ServiceStore(std::unique_ptr<Access> access);
  ~ServiceStore();
  ServiceStore(const ServiceStore&) = delete;
  ServiceStore& operator=(const ServiceStore&) = delete;

  // Changes with every commit of any process or thread: then lists can differ.
  std::int64_t Version();

  std::vector<ApiKeyRecord> Keys();  // oldest first, with revoked ones
  void AddKey(const ApiKeyRecord& key);
  // By id, or by name if one valid key has it. false = no such key. Throws kConflict
  // "key_ambiguous" if several keys have that name.
  bool RevokeKey(const std::string& id_or_name);
  std::uint64_t ForgetRevokedKeys();  // how many

  // This process's name as an owner of jobs. Others can ask whether the owner still lives. If a
  // file represents the process, the first call creates it.
  const std::string& Owner();
  bool Lives(const std::string& owner);

  std::vector<JobRecord> Jobs();  // oldest first
  // Adds the job, or replaces the one with its id. false = that job now has another owner, and
  // stays.
  bool SaveJob(const JobRecord& job);
  // Adds a job with its input, which is kept until the job is saved as ended.
  void AddJob(const JobRecord& job, std::span<const std::uint8_t> input);
  // nullopt if there is none.
  std::optional<std::vector<std::uint8_t>> JobInput(const std::string& id);
  // A job's results per item, as text, numbered from 0; removed with the job. Add: writes the
  // results from `first` on, and replaces existing ones.
  void AddJobItems(const std::string& id, std::uint64_t first,
                   const std::vector<std::string>& items);
  std::vector<std::string> JobItems(const std::string& id, std::uint64_t first, int limit);
  // Adds the job unless a job of its kind in its collection has not ended, on any server. false =
  // there is one, and nothing was written.
  bool AddOnlyJob(const JobRecord& job);
  // Makes this process the owner of a job that has not ended. false = `from` is no longer its
  // owner.
  bool TakeJob(const std::string& id, const std::string& from);
  void RequestCancel(const std::string& id);
  void KeepNewestJobs(std::size_t count);  // forgets older ones that have ended

  // Requests that can be sent again, kept for a day. A request is begun again if its process no
  // longer lives, or if this process began it without ending it.
  RequestState BeginRequest(const RepeatableRequest& request);
  // nullopt = it failed: the request is removed, and can be sent again.
  void EndRequest(const RepeatableRequest& request, const std::optional<std::string>& answer);

 private:
  const std::unique_ptr<Access> access_;
};

}  // namespace pliant
