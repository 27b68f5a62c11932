// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What several servers agree on through ZooKeeper or ClickHouse Keeper: small values with versions,
// numbers that are given out once, leases and locks.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "index/store/clickhouse/database_url.h"

namespace pliant::clickhouse {

struct KeeperOptions {
  std::vector<HostPort> hosts;  // asked in any order, those that answer first
  std::string root;             // "/pliant/DATABASE"; made when absent
  // How long a server that went silent keeps its leases. The Keeper may choose another one.
  std::chrono::milliseconds session_timeout{10000};
  std::chrono::milliseconds timeout{5000};  // of a call, connecting included
};

struct KeeperValue {
  std::string text;
  std::int32_t version = 0;  // 0 when made, one more with each Write
  std::int64_t made = 0;     // czxid: greater than that of everything that was made before
};

// Something that one process has at a time. It ends with the object, with the Keeper object that
// gave it, with its session and with the process.
class KeeperLease {
 public:
  // Gives it back without waiting for it: for a moment somebody still has it. Never throws.
  ~KeeperLease();
  KeeperLease(const KeeperLease&) = delete;
  KeeperLease& operator=(const KeeperLease&) = delete;

  std::int64_t token() const;  // czxid: greater than that of every earlier holder
  // False once the session is lost, or may be: a session that has not been heard of for nearly its
  // timeout, by our own clock, is lost. Then it stays false. Thread-safe, asks nobody.
  bool held() const;

 private:
  friend class Keeper;
  struct Impl;
  explicit KeeperLease(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

// Thread-safe. Paths are relative to the root, without / at either end: "jobs/17". Every function
// throws
//   kUnavailable "keeper_unavailable" when no Keeper answers in time, or the session is lost
//     underneath: what was asked may then have been done or not. The next call makes a new session;
//     leases of the old one stay lost;
//   kInvalidArgument "keeper_path_invalid", "keeper_version_invalid", kTooLarge
//     "keeper_text_too_large" (a text has at most kMaxTextBytes), kConflict "keeper_path_leased"
//     (below a lease), kInternal "keeper_error" (the Keeper forbids it).
class Keeper {
 public:
  static constexpr std::size_t kMaxTextBytes = 1000000;

  // Connects to nobody yet. Throws kInvalidArgument "keeper_options_invalid".
  explicit Keeper(KeeperOptions options);
  // Ends the session, and with it all leases.
  ~Keeper();
  Keeper(const Keeper&) = delete;
  Keeper& operator=(const Keeper&) = delete;

  std::optional<KeeperValue> Read(const std::string& path);
  // Makes what is above it, too. False: it is there.
  bool Create(const std::string& path, const std::string& text);
  // False: another version is there, or none.
  bool Write(const std::string& path, const std::string& text, std::int32_t version);
  // False: none was there. Throws kConflict "keeper_not_empty" where something is below it.
  bool Remove(const std::string& path);
  // The names of what is directly below, sorted; none where the path is not there.
  std::vector<std::string> Children(const std::string& path);

  // The first of `count` numbers that nobody else gets; the counter begins with `start`. Numbers
  // are left out after a failure. Throws kUnavailable "keeper_busy" when others always came first,
  // kCorrupt "keeper_corrupt" when something else is there, kConflict "keeper_numbers_exhausted".
  std::uint64_t TakeNumbers(const std::string& path, std::uint64_t count, std::uint64_t start = 1);

  // Null: somebody has it. `text` is for others to read.
  std::unique_ptr<KeeperLease> TryLease(const std::string& path, const std::string& text);
  // First come, first served. The path is for locks alone, and goes with the last of them. Throws
  // kUnavailable "keeper_busy" when `until` passes, kCancelled "cancelled" for `stop`.
  std::unique_ptr<KeeperLease> Lock(const std::string& path,
                                    std::chrono::steady_clock::time_point until,
                                    std::stop_token stop = {});

 private:
  class Impl;
  class Taking;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant::clickhouse
