// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The job that adds the images of a folder on the server, which must lie below the directory
// given with --import-dir.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "index/engine/engine.h"
#include "index/files/image_files.h"
#include "server/jobs/jobs.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

struct ImportOptions {
  std::filesystem::path directory;  // --import-dir; empty = importing is off
  std::int64_t max_bytes = 0;       // of one image
  std::function<void(const std::string& collection)> on_added;
};

// The folder named by the relative path `name` of a client. Throws ProblemError "imports_off", and
// "invalid_parameter" for a path that is absolute, contains "..", leads outside through a link, or
// is not a folder. The messages do not reveal the location of the directory.
std::filesystem::path ResolveImportFolder(const std::filesystem::path& directory,
                                          const std::string& name);

JobStatus AddImportJob(JobQueue& jobs, const CollectionRecord& collection,
                       const std::string& folder, const std::string& object_from);

// The parameter of a job that says when the collection that it was asked for was made.
inline constexpr const char* kCollectionCreated = "collection_created_ms";

// Into the job's collection, and no other that has its name by now.
void KeepTo(const JobStatus& job, AddRequest& request);

// How many images an import has under way: the pool gives cores to a part of them, and the others
// wait for the store meanwhile, which commits them together. What was under way when a server was
// killed is looked at once more.
int ImportsAtOnce(const WorkerPool& pool);

// Ends an import that was told to stop; as an Error kCancelled "import_cancelled".
[[noreturn]] void ThrowImportStopped();

// Adds in the background lane. Waits while another process holds the database. An image that still
// waits for a core when `stop` is requested is not begun (ThrowImportStopped).
AddResult AddPatiently(Engine& engine, WorkerPool& pool, const AddRequest& request,
                       const std::stop_token& stop);

// Kind "import". Stored images are skipped, so it can be resumed after a restart. Images are
// described in the background lane of `pool`. All must outlive the queue.
void RegisterImportJob(JobQueue& jobs, Engine& engine, WorkerPool& pool, ImportOptions options);

}  // namespace pliant::server
