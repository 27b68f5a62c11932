// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/problem.h"

#include <algorithm>
#include <exception>
#include <new>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <spdlog/spdlog.h>

#include "index/files/text.h"
#include "server/http/json.h"

namespace pliant::server {

namespace {

constexpr int kDefaultRetryAfterS = 1;
constexpr std::size_t kMostDetailBytes = 2048;
constexpr std::size_t kMostParameterBytes = 128;
constexpr std::string_view kInvalidSuffix = "_invalid";

const ProblemCode* FindCode(const std::string& code) {
  const std::span<const ProblemCode> codes = ProblemCodes();
  const auto it = std::find_if(codes.begin(), codes.end(),
                               [&](const ProblemCode& known) { return code == known.code; });
  return it == codes.end() ? nullptr : &*it;
}

Problem MakeProblem(const std::string& code, const std::string& detail) {
  Problem problem;
  if (const ProblemCode* known = FindCode(code)) {
    problem.status = known->status;
    problem.code = code;
    problem.detail = detail;
  } else {
    problem = {.status = 500, .code = "internal", .internal = "unlisted problem code " + code};
  }
  if (problem.status == 503) problem.retry_after_s = kDefaultRetryAfterS;
  return problem;
}

// What a client may know of a failure on this side.
std::string PublicDetail(const std::string& code) {
  if (code == "database_unavailable") return "The database does not answer. Try again later.";
  if (code == "database_outcome_unknown") {
    return "Outcome unknown. Check before retrying.";
  }
  if (code == "busy") return "The server is busy. Try again shortly.";
  if (code == "read_only") return "The server may not write where it keeps this.";
  if (code == "no_space") return "The server has no space left to store this.";
  return "Something went wrong on the server. Its log has more under the request id.";
}

Problem FromError(const Error& error) {
  Problem problem;
  problem.status = StatusOf(error.code());
  if (problem.status < 500) {
    problem.code = error.reason();
    problem.detail = error.what();
    // The engine's "limit_invalid" is one code with a named parameter here.
    if (error.code() == ErrorCode::kInvalidArgument && problem.code.ends_with(kInvalidSuffix)) {
      problem.parameter = problem.code.substr(0, problem.code.size() - kInvalidSuffix.size());
      problem.code = "invalid_parameter";
    }
    return problem;
  }
  const ProblemCode* known = FindCode(error.reason());
  const bool own = problem.status == 503 && known != nullptr && known->status == 503;
  problem.code = own                                    ? error.reason()
                 : problem.status == 503                ? "busy"
                 : problem.status == 507                ? "no_space"
                 : error.code() == ErrorCode::kReadOnly ? "read_only"
                                                        : "internal";
  problem.detail = PublicDetail(problem.code);
  problem.internal = error.reason() + ": " + error.what();
  if (problem.status == 503) problem.retry_after_s = kDefaultRetryAfterS;
  return problem;
}

// An answer repeats no more of a request than people read.
Problem Bounded(Problem problem) {
  if (problem.detail.size() > kMostDetailBytes) {
    problem.detail = Shown(problem.detail, kMostDetailBytes);
  }
  if (problem.parameter.size() > kMostParameterBytes) {
    problem.parameter = Shown(problem.parameter, kMostParameterBytes);
  }
  return problem;
}

}  // namespace

ProblemError::ProblemError(const std::string& code, const std::string& detail)
    : ProblemError(MakeProblem(code, detail)) {}

ProblemError::ProblemError(Problem problem)
    : std::runtime_error(problem.code + ": " + problem.detail), problem_(std::move(problem)) {}

ProblemError& ProblemError::Parameter(std::string name) {
  problem_.parameter = std::move(name);
  return *this;
}

ProblemError& ProblemError::RetryAfter(int seconds) {
  problem_.retry_after_s = seconds;
  return *this;
}

ProblemError& ProblemError::Allow(std::string methods) {
  problem_.allow = std::move(methods);
  return *this;
}

ProblemError& ProblemError::ContentRange(std::string range) {
  problem_.content_range = std::move(range);
  return *this;
}

Problem CurrentProblem() {
  try {
    throw;
  } catch (const ProblemError& error) {
    return Bounded(error.problem());
  } catch (const Error& error) {
    return Bounded(FromError(error));
  } catch (const std::bad_alloc&) {
    return {.status = 503,
            .code = "busy",
            .detail = PublicDetail("busy"),
            .retry_after_s = kDefaultRetryAfterS,
            .internal = "out of memory"};
  } catch (const std::exception& error) {
    return {.status = 500,
            .code = "internal",
            .detail = PublicDetail("internal"),
            .internal = error.what()};
  } catch (...) {
    return {.status = 500,
            .code = "internal",
            .detail = PublicDetail("internal"),
            .internal = "an exception of an unknown type"};
  }
}

void LogProblem(const Problem& problem) {
  if (!problem.internal.empty()) spdlog::warn("{}: {}", problem.code, problem.internal);
}

Response ProblemResponse(const Problem& problem, const std::string& request_id) {
  Json body = {{"type", "urn:pliant:problem:" + problem.code},
               {"title", StatusTitle(problem.status)},
               {"status", problem.status},
               {"code", problem.code},
               {"detail", problem.detail},
               {"request_id", request_id}};
  if (!problem.parameter.empty()) body["parameter"] = problem.parameter;
  if (problem.stored) {
    body["image_id"] = problem.stored->image_id;
    body["object"] = problem.stored->object;
  }
  if (problem.progress >= 0) body["progress"] = problem.progress;
  Response response;
  response.status = problem.status;
  response.content_type = "application/problem+json";
  response.body = ToText(body);
  response.headers.emplace_back("Cache-Control", "no-store");
  if (problem.status == 401) {
    response.headers.emplace_back("WWW-Authenticate", "Bearer realm=\"pliant\"");
  }
  if (!problem.allow.empty()) response.headers.emplace_back("Allow", problem.allow);
  if (!problem.content_range.empty()) {
    response.headers.emplace_back("Content-Range", problem.content_range);
  }
  if (problem.retry_after_s > 0) {
    response.headers.emplace_back("Retry-After", std::to_string(problem.retry_after_s));
  }
  return response;
}

}  // namespace pliant::server
