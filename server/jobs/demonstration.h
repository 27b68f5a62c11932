// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Demonstration objects for a first try: rendered by the simulator, so that an installed server
// needs no files for them.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "index/engine/engine.h"
#include "server/jobs/jobs.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

// The id under which object `number` is added: "demo-town-map".
std::string DemonstrationId(std::size_t number);

// Whether any of the objects is in the collection. Throws Error kNotFound for the collection.
bool HasDemonstration(Engine& engine, const std::string& collection);

// The crumpled objects as JPEG, to be used as queries. Rendered on first use, then kept.
// Thread-safe.
class CrumpledPictures {
 public:
  CrumpledPictures();

  // Null when there is no object of that number. Rendering takes about a second.
  std::shared_ptr<const std::string> Get(std::size_t number);

 private:
  struct Picture {
    std::once_flag once;
    std::shared_ptr<const std::string> jpeg;
  };
  std::vector<std::unique_ptr<Picture>> pictures_;
};

// The job that adds the objects to the collection and renders their crumpled pictures. Existing
// ones are skipped. Throws Error kNotFound for the collection.
JobStatus AddDemonstrationJob(Engine& engine, JobQueue& jobs, const std::string& collection);

// Kind "demo"; it starts again after a restart. `on_added` is called with the collection. All
// arguments must outlive the queue.
void RegisterDemonstrationJob(JobQueue& jobs, Engine& engine, WorkerPool& pool,
                              CrumpledPictures& crumpled,
                              std::function<void(const std::string& collection)> on_added);

}  // namespace pliant::server
