// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Conditions and ranges of requests (RFC 9110, sections 13 and 14).
#pragma once

#include <string>

#include "server/http/message.h"

namespace pliant::server {

// ETags are strong, and given with their quotes. A compressed answer's ETag ends in the coding
// ("x-gzip" for "x"); here both name the same answer.

// Whether the request has no If-Match, or one that is * or lists `etag`. Weak tags match nothing.
bool IfMatchHolds(const Request& request, const std::string& etag);

// The first tag of If-None-Match that names `etag`, or `etag` itself for *; empty = none.
std::string NamedByIfNoneMatch(const Request& request, const std::string& etag);

// The answer to a GET under the request's conditions: `whole`, nothing (304), or a part of it (206)
// if `whole` has "Accept-Ranges: bytes". Answers without an ETag stay as they are. Several ranges
// and other units are ignored. Throws ProblemError "precondition_failed", "range_not_satisfiable".
Response UnderConditions(const Request& request, Response whole);

}  // namespace pliant::server
