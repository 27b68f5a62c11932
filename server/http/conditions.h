// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Conditions and ranges of requests (RFC 9110, sections 13 and 14).
#pragma once

#include <cstddef>
#include <string>

#include "server/http/message.h"
#include "server/http/problem.h"

namespace pliant::server {

// ETags are strong, and given with their quotes. The one of a compressed answer ends in the coding
// ("x" is "x-gzip" then); here both name the same.

// Whether If-Match lets a request through: there is none, it is *, or lists `etag`. Weak ones match
// nothing.
bool IfMatchHolds(const Request& request, const std::string& etag);

// The first that If-None-Match lists and that means `etag`, or `etag` itself for *; empty = none.
std::string NamedByIfNoneMatch(const Request& request, const std::string& etag);

// "range_not_satisfiable": the range is outside of the `bytes` that there are.
class RangeOutside : public ProblemError {
 public:
  explicit RangeOutside(std::size_t bytes);
};

// The answer to a GET under the request's conditions: `whole`, nothing (304), or a part of it (206)
// where `whole` has "Accept-Ranges: bytes". Only for answers with an ETag; others are returned as
// they are. Several ranges at once, and what is no range of bytes, are not looked at. Throws
// ProblemError "precondition_failed", RangeOutside.
Response UnderConditions(const Request& request, Response whole);

}  // namespace pliant::server
