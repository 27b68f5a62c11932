// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A job as it is kept in the database, and back.
#pragma once

#include "index/store/service_store.h"
#include "server/jobs/jobs.h"

namespace pliant::server {

JobRecord ToRecord(const JobStatus& status, const std::string& owner);
// What is missing in the record's JSON, or of another type, is left out.
JobStatus FromRecord(const JobRecord& record);

}  // namespace pliant::server
