// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/reader_floor.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <random>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"

namespace pliant::clickhouse {
namespace {

constexpr std::chrono::seconds kFirstAfter{2};
constexpr std::chrono::seconds kEvery{5};

std::string NewPath() {
  std::random_device random;
  std::array<std::uint8_t, 16> bytes;
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return std::string(kReaders) + "/" + ToHex(bytes);
}

}  // namespace

ReaderFloor::ReaderFloor(Snapshots* snapshots, std::shared_ptr<Keeper> keeper)
    : snapshots_(*snapshots), keeper_(std::move(keeper)) {
  snapshots_.SetGuard([this] { return Guard(); });
  thread_ = std::thread([this] {
    std::unique_lock lock(mutex_);
    for (auto pause = kFirstAfter; !ends_.wait_for(lock, pause, [this] { return ending_; });
         pause = kEvery) {
      lock.unlock();
      try {
        Publish();
      } catch (const std::exception&) {
        // What stays published is older, so others wait longer than they must.
      }
      lock.lock();
    }
  });
}

ReaderFloor::~ReaderFloor() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  ends_.notify_all();
  thread_.join();
  snapshots_.SetGuard({});
}

std::uint64_t ReaderFloor::Guard() {
  const std::lock_guard lock(mutex_);
  return lease_ && lease_->held() ? guard_ : 0;
}

void ReaderFloor::Publish() {
  const std::lock_guard publishing(publishing_);
  // In this order: a snapshot that is opened from now on shows this commit at least.
  const std::uint64_t newest = snapshots_.Version();
  const std::uint64_t floor = std::min(newest, snapshots_.open().Oldest().value_or(newest));
  if (Guard() != 0) {
    if (floor == published_) return;
    const auto now = keeper_->Read(path_);
    if (now && keeper_->Write(path_, std::to_string(floor), now->version)) published_ = floor;
    return;
  }
  path_ = NewPath();
  auto lease = keeper_->TryLease(path_, std::to_string(floor));
  if (!lease) return;
  published_ = floor;
  const std::lock_guard lock(mutex_);
  lease_ = std::move(lease);
  ++guard_;
}

std::vector<std::uint64_t> ReadFloors(Keeper& keeper) {
  std::vector<std::uint64_t> floors;
  for (const std::string& name : keeper.Children(kReaders)) {
    const auto value = keeper.Read(std::string(kReaders) + "/" + name);
    if (value) floors.push_back(std::strtoull(value->text.c_str(), nullptr, 10));
  }
  std::sort(floors.begin(), floors.end());
  return floors;
}

}  // namespace pliant::clickhouse
