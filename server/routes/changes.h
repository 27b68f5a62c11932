// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Changing records in place: merge patches (RFC 7396), and the ETags that say which state is meant
// (RFC 9110, sections 8.8.3 and 13.1.1).
#pragma once

#include <string>
#include <vector>

#include "index/json/json.h"
#include "server/http/message.h"

namespace pliant::server {

// Strong, with its quotes; differs when the record does.
std::string EtagOf(const Json& record);

// The record, with its ETag.
Response RecordResponse(const Json& record);
// The same for what is no record, and may be long: kept by clients that ask whether it is the same.
Response TaggedResponse(const Json& json);

// Throws ProblemError "precondition_failed" when the request has an If-Match that is neither * nor
// lists the record's ETag.
void CheckIfMatch(const Request& request, const Json& record);
// The same for what may not be there (null): nothing matches then. Also throws when If-None-Match
// is
// * and there is something, or lists its ETag.
void CheckConditionsOf(const Request& request, const Json& record_or_null);

// The body. Throws ProblemError "missing_parameter" without one, "invalid_json", and
// "unknown_parameter" for a key that is none of `fields` (empty = any key will do).
Json MergePatchOf(const Request& request, const std::vector<std::string>& fields);
// Its text of that key, where null is the same as "". Absent = stays as it is. Throws ProblemError
// "invalid_parameter".
std::optional<std::string> TextIn(const Json& patch, const std::string& name);

}  // namespace pliant::server
