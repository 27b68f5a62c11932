// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The jobs that train and activate vocabularies.
#pragma once

#include <optional>
#include <string>

#include "index/engine/engine.h"
#include "server/jobs/jobs.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

// Queues the training of a vocabulary. `activate` = activate it when it is done.
JobStatus AddTrainingJob(JobQueue& jobs, const TrainOptions& options, bool activate);
// The same for one that nobody asked for (options.automatic). It is activated; one whose collection
// has a vocabulary that still suits when its turn comes trains nothing. Nothing = a training of the
// collection has not ended, here or at another server.
std::optional<JobStatus> AddAutomaticTrainingJob(JobQueue& jobs, const TrainOptions& options);
// Queues the switch to a vocabulary with which images must be quantised first.
JobStatus AddActivationJob(JobQueue& jobs, const std::string& collection, std::int64_t vocabulary);

// Kinds "train" and "activate": both start again after a restart, with the same result.
// Each takes half of the cores. `engine` and `pool` must outlive the queue.
void RegisterVocabularyJobs(JobQueue& jobs, Engine& engine, WorkerPool& pool);

}  // namespace pliant::server
