// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What /metrics says of the database. A file is read for every request. A database on a server may
// be slow or gone: a thread asks it, at most every few seconds, and requests do not wait long.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "index/engine/engine.h"

namespace pliant::server {

// Thread-safe. The engine must outlive it.
class StoreFigures {
 public:
  StoreFigures(Engine* engine, bool on_server) : engine_(*engine), on_server_(on_server) {}

  // Waits at most a moment for figures that are not too old; then gives the last ones, or nothing
  // if there never were any. Of a file throws what Engine::Stats throws.
  std::optional<EngineStats> Get();

 private:
  using Clock = std::chrono::steady_clock;

  void Read(const std::stop_token& stop);

  Engine& engine_;
  const bool on_server_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable_any changed_;
  bool wanted_ = false;
  std::optional<EngineStats> stats_;
  Clock::time_point asked_at_;  // when the last answer or failure came
  std::jthread reader_;         // after the first Get
};

}  // namespace pliant::server
