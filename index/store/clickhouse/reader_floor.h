// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Tells others, through the Keeper, how far back this process may still read. Private to
// store/clickhouse.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "index/store/clickhouse/keeper.h"
#include "index/store/clickhouse/snapshot.h"

namespace pliant::clickhouse {

inline constexpr const char* kReaders = "readers";  // a lease each; its text is the floor

// A thread that publishes, every few seconds, the version of the oldest snapshot that is open, or
// of the newest commit when none is. Who reads that it is beyond a commit knows that this process
// reads nothing that was before. Without a Keeper nothing is published; then Snapshots::RequireKept
// looks for itself. Short-lived processes end before they publish anything.
class ReaderFloor {
 public:
  ReaderFloor(Snapshots* snapshots, std::shared_ptr<Keeper> keeper);
  ~ReaderFloor();
  ReaderFloor(const ReaderFloor&) = delete;
  ReaderFloor& operator=(const ReaderFloor&) = delete;

  // Publishes now. Throws what Keeper and Snapshots throw.
  void Publish();

 private:
  std::uint64_t Guard();

  Snapshots& snapshots_;
  const std::shared_ptr<Keeper> keeper_;
  std::mutex publishing_;  // one at a time; guards path_ and published_
  std::string path_;
  std::uint64_t published_ = 0;
  std::mutex mutex_;  // guards the rest
  std::unique_ptr<KeeperLease> lease_;
  std::uint64_t guard_ = 0;
  bool ending_ = false;
  std::condition_variable ends_;
  std::thread thread_;
};

// The floors that are published, lowest first.
std::vector<std::uint64_t> ReadFloors(Keeper& keeper);

}  // namespace pliant::clickhouse
