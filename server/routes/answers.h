// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Answers in JSON, with the ETags that identify the state of a record (RFC 9110, sections 8.8.3 and
// 13.1.1), and jobs.
#pragma once

#include <string>

#include "index/json/json.h"
#include "server/http/message.h"
#include "server/http/problem.h"
#include "server/jobs/job_store.h"

namespace pliant::server {

// `location`: the address of what was created; empty = none.
Response JsonResponse(const Json& json, int status = 200, const std::string& location = {});

// Strong, with its quotes; differs when the record does.
std::string EtagOf(const Json& record);
// The record with its ETag.
Response RecordResponse(const Json& record, int status = 200);
// The same, and clients may keep the answer and ask whether it is current.
Response TaggedResponse(const Json& json);

// Throws ProblemError "precondition_failed" for an If-Match that is neither * nor lists the
// record's ETag.
void CheckIfMatch(const Request& request, const Json& record);
// The same for a record that may be absent (null): then any If-Match fails. Also throws for an
// If-None-Match that is * or lists the ETag of a present record.
void CheckConditionsOf(const Request& request, const Json& record_or_null);

Json JobJson(const JobStatus& job);
// 202 with the job and its address.
Response JobResponse(const JobStatus& job);

Json ProblemSummary(const Problem& problem);  // code, detail, parameter

}  // namespace pliant::server
