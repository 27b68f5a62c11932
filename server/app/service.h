// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the routes work with, and the whole server put together.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <vector>

#include "index/engine/engine.h"
#include "index/store/service_store.h"
#include "server/app/metrics.h"
#include "server/app/options.h"
#include "server/http/router.h"
#include "server/jobs/auto_trainer.h"
#include "server/jobs/backups.h"
#include "server/jobs/demonstration.h"
#include "server/jobs/jobs.h"
#include "server/jobs/worker_pool.h"
#include "server/routes/thumbnails.h"

namespace pliant::server {

// Everything the handlers share. Made before the index is loaded; engine() only after Open().
class Service {
 public:
  explicit Service(const ServerOptions& options);
  ~Service();

  // Loads the index. Throws what Engine's constructor throws.
  void Open();

  Engine& engine() { return *engine_; }
  bool ready() const { return ready_; }
  double loaded() const { return loaded_; }                    // which share of the index, 0..1
  AutoTrainer* auto_trainer() { return auto_trainer_.get(); }  // null when switched off

  const ServerOptions options;
  WorkerPool pool;
  ThumbnailCache thumbnails;
  CrumpledPictures crumpled_pictures;
  Metrics metrics;
  const Backups backups;
  // Jobs use the engine, so they end first: see ~Service. Null before Open().
  std::unique_ptr<JobQueue> jobs;

 private:
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<ServiceStore> store_;
  std::unique_ptr<AutoTrainer> auto_trainer_;
  std::atomic<bool> ready_{false};
  std::atomic<double> loaded_{0};
};

// The route table. `service` must outlive it.
std::vector<Route> MakeRoutes(Service& service);

// Runs until SIGTERM or SIGINT. Returns the exit status: 0 stopped cleanly, 1 failed (also when
// requests had to be cut off at the end).
int RunServer(const ServerOptions& options);

}  // namespace pliant::server
