// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The jobs by which collections test themselves.
#pragma once

#include "index/selftest/self_test.h"
#include "server/jobs/job_runner.h"
#include "server/jobs/worker_pool.h"

namespace pliant::server {

// Queues a self-test: options.collection, pictures, false_alarms and seed.
JobStatus AddSelfTestJob(JobStore& jobs, const SelfTestOptions& options);

// Kind "selftest"; it begins again after a restart. It takes half of the cores, and stores its
// report with the collection. `engine` and `pool` must outlive the runner.
void RegisterSelfTestJob(JobRunner& runner, Engine& engine, WorkerPool& pool, ImageDecoder decode);

}  // namespace pliant::server
