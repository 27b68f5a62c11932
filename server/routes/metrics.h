// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Counters, gauges and histograms for Prometheus; server/reference/flags.md lists them.
#pragma once

#include <chrono>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "index/engine/engine.h"
#include "server/decoder/decoder_process.h"
#include "server/http/http_server.h"
#include "server/jobs/job_store.h"
#include "server/jobs/worker_pool.h"
#include "server/peers/peers.h"

namespace pliant::server {

// The figures of the database. Get() reads a file each time. A database server can be slow or gone:
// another thread asks it, at most every few seconds, and Get() does not wait long. Thread-safe. The
// engine must outlive it.
class StoreFigures {
 public:
  StoreFigures(Engine* engine, bool on_server) : engine_(*engine), on_server_(on_server) {}

  // Waits a second for recent figures, then returns the last ones; nothing if there are none yet.
  // For a file throws what Engine::Stats throws.
  std::optional<EngineStats> Get();

 private:
  using Clock = std::chrono::steady_clock;

  Engine& engine_;
  const bool on_server_;
  std::mutex mutex_;  // guards what follows
  std::optional<EngineStats> stats_;
  Clock::time_point answered_at_;          // time of the last answer or failure
  std::shared_future<EngineStats> asked_;  // valid while the database is asked
};

// Values at the time of the request.
struct MetricsNow {
  WorkerPool::Load load = {};
  const EngineStats* stats = nullptr;  // null = not known yet
  // Absent: the database is away.
  std::optional<std::map<JobState, std::size_t>> jobs{std::in_place};
  std::size_t decoders = 0;            // processes
  std::uintmax_t disk_free_bytes = 0;  // for the database
};

// Thread-safe.
class Metrics {
 public:
  Metrics();
  ~Metrics();

  void OnRequest(const RequestRecord& record);
  void OnSearch(const SearchTimings& timings, const std::string& collection);
  void OnAdd(const AddTimings& timings, const std::string& collection);
  void OnDecoderEnded(DecoderEnded::Cause cause);
  void OnPeer(std::size_t part, PeerOutcome outcome, double seconds);

  std::string Text(const MetricsNow& now);  // the text exposition format

 private:
  class Impl;

  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant::server
