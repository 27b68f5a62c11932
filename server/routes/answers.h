// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What routes answer with: JSON, and jobs.
#pragma once

#include "index/json/json.h"
#include "server/http/message.h"
#include "server/http/problem.h"
#include "server/jobs/job_store.h"

namespace pliant::server {

Response JsonResponse(const Json& json, int status = 200);

Json JobJson(const JobStatus& job);
// 202 with the job and its address.
Response JobResponse(const JobStatus& job);

Json ProblemSummary(const Problem& problem);  // code, detail, parameter

}  // namespace pliant::server
