// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Counters, gauges and histograms for Prometheus; server/reference/flags.md lists them.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "index/engine/engine.h"
#include "server/decoder/decoder_process.h"
#include "server/http/http_server.h"
#include "server/jobs/jobs.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

// Values that are read when the metrics are requested.
struct MetricsNow {
  WorkerPool::Load load = {};
  const EngineStats* stats = nullptr;  // null = not known yet
  std::map<JobState, std::size_t> jobs = {};
  std::size_t decoders = 0;            // processes
  std::uintmax_t disk_free_bytes = 0;  // for the database
};

// Thread-safe.
class Metrics {
 public:
  Metrics();
  ~Metrics();

  void OnRequest(const RequestRecord& record);
  void OnSearch(const SearchTimings& timings);
  void OnAdd(const AddTimings& timings);
  void OnDecoderEnded(DecoderEnded::Cause cause);

  std::string Text(const MetricsNow& now);  // the text exposition format

 private:
  class Impl;

  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant::server
