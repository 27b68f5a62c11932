// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What /metrics says of the database. A file is asked at once. A cluster, of which a part may be
// gone, is asked aside, at most every few seconds, and nobody waits long for it.
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "index/engine/engine.h"

namespace pliant::server {

struct Figures {
  std::optional<EngineStats> stats;  // of the last time that all shards answered; absent: never
  std::vector<ShardRecord> shards;   // none of a file
  double age_s = 0;                  // of `shards`
};

// Thread-safe. The engine must outlive it.
class StoreFigures {
 public:
  StoreFigures(Engine* engine, bool is_cluster) : engine_(*engine), is_cluster_(is_cluster) {}

  // Waits for figures that are not too old, but not longer than for a moment. Of a file throws what
  // Engine::Stats throws.
  Figures Get();

 private:
  using Clock = std::chrono::steady_clock;

  void Read(const std::stop_token& stop);

  Engine& engine_;
  const bool is_cluster_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable_any changed_;
  bool wanted_ = false;
  std::optional<EngineStats> stats_;
  std::vector<ShardRecord> shards_;
  Clock::time_point read_at_;  // the shards
  std::jthread reader_;        // after the first Get
};

}  // namespace pliant::server
