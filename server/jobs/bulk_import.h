// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The background job that adds the images of one body (bulk_items.h).
#pragma once

#include <functional>
#include <string>

#include "index/engine/engine.h"
#include "server/fetch/fetcher.h"
#include "server/jobs/bulk_files.h"
#include "server/jobs/bulk_items.h"
#include "server/jobs/jobs.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

// The body is kept in the database until the job has ended. Throws what BulkItems throws for the
// body, and what JobQueue::Add throws.
JobStatus AddBulkImportJob(JobQueue& jobs, const CollectionRecord& collection,
                           const std::string& body, const std::string& type,
                           const BulkDefaults& defaults);

// The same of a body that is a file: that of the job from then on.
JobStatus AddBulkImportJob(JobQueue& jobs, const CollectionRecord& collection, BulkUpload& body,
                           const std::string& type, const BulkDefaults& defaults);

// `on_added` hears of the collection for each image that was added; any thread. What the job says
// of an item (ServiceStore::JobItems) is a JSON object: "index", "source", "status" as a request of
// its own would have, and "outcome", "image_id" and "object", or "problem". Begun again after an
// interruption it goes on behind the items that it has said something of.
void RegisterBulkImportJob(JobQueue& jobs, Engine& engine, WorkerPool& pool, Fetcher& fetcher,
                           const BulkFiles& files,
                           std::function<void(const std::string& collection)> on_added);

}  // namespace pliant::server
