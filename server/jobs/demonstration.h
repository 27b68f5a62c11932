// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Demonstration objects for a first try. Their images are files of server/web/demo.
#pragma once

#include <array>
#include <functional>
#include <string>

#include "index/engine/engine.h"
#include "server/jobs/jobs.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

struct DemonstrationObject {
  const char* name;
  const char* file;  // FILE.jpg is indexed under the id "demo-FILE", FILE-crumpled.jpg is a query
  const char* made_of;

  std::string id() const { return std::string("demo-") + file; }
};

inline constexpr std::array<DemonstrationObject, 6> kDemonstrationObjects{{
    {"town map", "town-map", "paper"},
    {"tea packet", "tea-packet", "paper"},
    {"newspaper", "newspaper", "paper"},
    {"flower cloth", "flower-cloth", "cloth"},
    {"poster", "poster", "paper"},
    {"team flag", "team-flag", "cloth"},
}};

// Whether any of the objects is in the collection. Throws Error kNotFound for the collection.
bool HasDemonstration(Engine& engine, const std::string& collection);

// The job that adds the objects to the collection. Existing ones are skipped. Throws Error
// kNotFound for the collection.
JobStatus AddDemonstrationJob(Engine& engine, JobQueue& jobs, const std::string& collection);

// Kind "demo"; it starts again after a restart. `on_added` is called with the collection. All
// arguments must outlive the queue.
void RegisterDemonstrationJob(JobQueue& jobs, Engine& engine, WorkerPool& pool,
                              std::function<void(const std::string& collection)> on_added);

}  // namespace pliant::server
