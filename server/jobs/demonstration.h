// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Demonstration objects for a first try. Their images are files of server/web/demo.
#pragma once

#include <array>
#include <string>

#include "server/jobs/import_jobs.h"

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

// The job that adds the objects to the collection. It skips existing ones. Throws Error kNotFound
// for the collection.
JobStatus AddDemonstrationJob(Engine& engine, JobStore& jobs, const std::string& collection);

// Kind "demo"; it begins again after a restart.
void RegisterDemonstrationJob(JobRunner& runner, ImportServices services);

}  // namespace pliant::server
