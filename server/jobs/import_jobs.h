// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The jobs that add many images: those of a folder below --import-dir, or of one request's body.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>

#include "index/engine/engine.h"
#include "server/fetch/fetcher.h"
#include "server/http/message.h"
#include "server/jobs/bulk_files.h"
#include "server/jobs/bulk_items.h"
#include "server/jobs/job_runner.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

// All references must outlive the runner.
struct ImportServices {
  JobStore& jobs;
  Engine& engine;
  WorkerPool& pool;
  Fetcher& fetcher;
  const BulkFiles& files;
  std::filesystem::path directory;  // --import-dir; empty = folder imports are off
  std::int64_t max_bytes = 0;       // of one image
  // Called for each image that was added; any thread.
  std::function<void(const std::string& collection)> on_added;
};

// The folder named by the relative path `name` of a client. Throws ProblemError "imports_off", and
// "invalid_parameter" for a path that is absolute, contains "..", leads outside through a link, or
// is not a folder. The messages do not reveal the location of the directory.
std::filesystem::path ResolveImportFolder(const std::filesystem::path& directory,
                                          const std::string& name);

JobStatus AddImportJob(JobStore& jobs, const CollectionRecord& collection,
                       const std::string& folder, const std::string& object_from);

// Adds the images of the request's body, which the database, or its file, keeps until the job ends.
// Throws what BulkItems throws for the body, and what JobStore::Add throws.
JobStatus AddBulkImportJob(JobStore& jobs, const CollectionRecord& collection,
                           const Request& request, const BulkDefaults& defaults);

// To call when a job of this server has ended: removes the file of its body, if there is one.
void RemoveBodyOf(const JobStatus& job, const BulkFiles& files);

// Kinds "import" and "bulk_import". Both can be resumed: the first skips stored images, the second
// continues after the items with a result. A result (ServiceStore::JobItems) is a JSON object:
// "index", "source", "status" (the HTTP status of a single upload), and either "outcome",
// "image_id" and "object", or "problem".
void RegisterImportJobs(JobRunner& runner, ImportServices services);

// The parameter of a job with the time at which its collection was made.
inline constexpr const char* kCollectionCreated = "collection_created_ms";

// Adds to the job's collection, in the background lane, and not to a later one of the same name.
// Waits while another process holds the database. Throws Error kCancelled "import_cancelled" for an
// image that still waits for a core when `stop` is requested.
AddResult AddInBackground(Engine& engine, WorkerPool& pool, const JobStatus& job,
                          AddRequest request, const std::stop_token& stop);

}  // namespace pliant::server
