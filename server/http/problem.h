// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Errors as application/problem+json (RFC 9457). This is the one place that maps an ErrorCode to
// an HTTP status, and the one list of the codes that the server itself answers with.
#pragma once

#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "server/http/message.h"

namespace pliant::server {

// The image that a problem is about.
struct StoredImage {
  std::string image_id;
  std::string object;
};

struct Problem {
  int status = 500;
  std::string code = {};           // stable, snake_case
  std::string detail = {};         // for people; says nothing internal when status is 5xx
  std::string parameter = {};      // the parameter at fault; empty = none
  std::string allow = {};          // 405: methods that the path has
  std::string content_range = {};  // 416: how much there is
  int retry_after_s = 0;           // 429 and 503; 0 = no header
  double progress = -1;            // "starting": which share of the index is loaded; < 0 = none
  std::string internal = {};       // for the log only
  std::optional<StoredImage> stored = {};  // "same_bytes": which has them
};

// A code that the server answers with. Other codes of the engine pass through when their status is
// below 500.
struct ProblemCode {
  const char* code;
  int status;
  const char* meaning;
};

std::span<const ProblemCode> ProblemCodes();
// Throws std::logic_error for a code that is not listed.
const ProblemCode& ProblemCodeOf(const std::string& code);

// Ends a request with a problem.
class ProblemError : public std::runtime_error {
 public:
  // ProblemCodes() gives the status. Throws std::logic_error for a code that is not listed.
  ProblemError(const std::string& code, const std::string& detail, Problem more = {});
  explicit ProblemError(Problem problem);

  const Problem& problem() const { return problem_; }

 private:
  Problem problem_;
};

// The exception being handled, as a problem: ProblemError, Error, or anything else as "internal".
Problem CurrentProblem();

Response ProblemResponse(const Problem& problem, const std::string& request_id);

// "Not Found" and so on (RFC 9110).
std::string StatusTitle(int status);

}  // namespace pliant::server
