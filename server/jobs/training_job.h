// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The jobs that make and switch vocabularies.
#pragma once

#include <string>

#include "index/engine/engine.h"
#include "server/jobs/jobs.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

// Asks for a vocabulary; shared by AutoTrainer and the route. `activate` = use it at once.
JobStatus AddTrainingJob(JobQueue& jobs, const TrainOptions& options, bool activate);
// Asks for the switch to a vocabulary that pictures have to be quantised with first.
JobStatus AddActivationJob(JobQueue& jobs, const std::string& collection, std::int64_t vocabulary);

// Kinds "train" and "activate": both begin anew after a restart, and end with the same vocabulary.
// Each takes half of the cores. `engine` and `pool` must outlive the queue.
void RegisterVocabularyJobs(JobQueue& jobs, Engine& engine, WorkerPool& pool);

}  // namespace pliant::server
