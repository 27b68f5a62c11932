// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Counters and histograms for Prometheus.
#pragma once

#include <memory>
#include <string>

#include "index/engine.h"
#include "server/http/http_server.h"
#include "server/worker_pool.h"

namespace pliant::server {

// Thread-safe.
class Metrics {
 public:
  Metrics();
  ~Metrics();

  void OnRequest(const RequestRecord& record);
  void OnSearch(const SearchTimings& timings);

  // The text exposition format. `stats` absent = the index is still loading.
  std::string Text(const WorkerPool::Load& load, const EngineStats* stats);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant::server
