// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/store_figures.h"

#include <algorithm>
#include <exception>

#include <spdlog/spdlog.h>

namespace pliant::server {

namespace {

constexpr std::chrono::seconds kFresh{5};
constexpr std::chrono::milliseconds kMostWait{1000};

bool AllAnswer(const std::vector<ShardRecord>& shards) {
  return std::all_of(shards.begin(), shards.end(),
                     [](const ShardRecord& shard) { return shard.answering > 0; });
}

}  // namespace

Figures StoreFigures::Get() {
  if (!is_cluster_) return {engine_.Stats(), {}, 0};
  std::unique_lock lock(mutex_);
  const Clock::time_point start = Clock::now();
  if (start - read_at_ > kFresh) {
    wanted_ = true;
    changed_.notify_all();
    if (!reader_.joinable()) {
      reader_ = std::jthread([this](const std::stop_token& stop) { Read(stop); });
    }
    changed_.wait_for(lock, kMostWait, [&] { return read_at_ >= start && stats_.has_value(); });
  }
  const std::chrono::duration<double> age = Clock::now() - read_at_;
  return {stats_, shards_, shards_.empty() ? 0 : age.count()};
}

void StoreFigures::Read(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return wanted_; })) {
    wanted_ = false;
    lock.unlock();
    std::vector<ShardRecord> shards;
    std::optional<EngineStats> stats;
    try {
      shards = engine_.Shards();
      {
        const std::lock_guard publish(mutex_);
        shards_ = shards;
        read_at_ = Clock::now();
      }
      if (AllAnswer(shards) && !stop.stop_requested()) stats = engine_.Stats();
    } catch (const std::exception& error) {
      spdlog::warn("the figures of the cluster cannot be read: {}", error.what());
    }
    lock.lock();
    if (stats) stats_ = std::move(stats);
    changed_.notify_all();
  }
}

}  // namespace pliant::server
