// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/problem.h"

#include <algorithm>
#include <array>
#include <exception>
#include <new>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <spdlog/spdlog.h>

#include "server/http/json.h"

namespace pliant::server {

namespace {

constexpr int kDefaultRetryAfterS = 1;
constexpr std::string_view kInvalidSuffix = "_invalid";

constexpr std::array kCodes = std::to_array<ProblemCode>({
    {"bad_request", 400, "the request is not valid HTTP, or its body is not what its type says"},
    {"invalid_parameter", 400,
     "a parameter has a value that is not accepted (`parameter` names it)"},
    {"unknown_parameter", 400, "the route has no such parameter (`parameter` names it)"},
    {"missing_parameter", 400, "a required parameter is absent (`parameter` names it)"},
    {"duplicate_parameter", 400, "a parameter was given twice (`parameter` names it)"},
    {"invalid_cursor", 400, "the cursor was not made by this list with these parameters"},
    {"invalid_json", 400, "the JSON body does not parse, is nested too deep or is not an object"},
    {"unauthorized", 401, "a key is needed, or the one shown does not work"},
    {"forbidden", 403, "the scope of the key does not include this"},
    {"cross_site", 403, "a web page of another site tried to change something"},
    {"route_not_found", 404, "there is nothing at this path"},
    {"collection_not_found", 404, "no such collection"},
    {"image_not_found", 404, "no picture of that id"},
    {"object_not_found", 404, "no picture of such an object"},
    {"vocabulary_not_found", 404, "no vocabulary of that number"},
    {"job_not_found", 404, "no such job, or it is long finished"},
    {"demo_not_found", 404, "no such demonstration object"},
    {"backup_not_found", 404, "no backup of that name"},
    {"method_not_allowed", 405, "the path exists, the method does not (Allow lists those that do)"},
    {"request_timeout", 408, "the request did not arrive in time"},
    {"no_vocabulary", 409, "nothing to search with yet; the detail says what to do"},
    {"imports_off", 409, "the operator has named no directory to import from"},
    {"backups_off", 409, "the operator has named no directory for backups"},
    {"backup_exists", 409, "there is a backup of that name"},
    {"interrupted", 409, "the server ended while the job ran, and it cannot go on (of a job)"},
    {"precondition_failed", 412, "what is stored is not what If-Match names: read it anew"},
    {"length_required", 411, "a body needs Content-Length or chunked transfer encoding"},
    {"body_too_large", 413, "the body is larger than --max-body-mb"},
    {"uri_too_long", 414, "the address is too long"},
    {"unsupported_content_type", 415, "the Content-Type is none that the route takes"},
    {"unsupported_content_encoding", 415, "compressed bodies are not taken"},
    {"range_not_satisfiable", 416, "the Range header cannot be understood"},
    {"expectation_failed", 417, "the Expect header asks for what the server does not do"},
    {"host_not_allowed", 421,
     "the Host header has a name that is none of the server's (--allowed-hosts)"},
    {"rate_limited", 429, "more requests than --rate-limit allows; Retry-After says when to go on"},
    {"headers_too_large", 431, "the headers are larger than --max-header-kb"},
    {"internal", 500, "a defect or damaged data; the server's log has the request id"},
    {"unsupported_transfer_encoding", 501, "only chunked transfer encoding is taken"},
    {"busy", 503, "too much to do at the moment; Retry-After says when to come again"},
    {"starting", 503, "the index is still loading"},
    {"stopping", 503, "the server is being stopped"},
    {"read_only", 500, "the server may not write where it keeps this"},
    {"no_space", 507, "the server's disk is full"},
});

constexpr std::array kEngineCodes = std::to_array<ProblemCode>({
    {"content_not_kept", 404, "the uploaded bytes were not stored (--keep-originals)"},
    {"collection_permanent", 409, "the collection `default` cannot be deleted"},
    {"same_bytes", 409, "the bytes are stored as a picture with another object or metadata"},
    {"object_exists", 409, "another object has the name; `merge=true` makes one of the two"},
    {"model_mismatch", 409, "the vocabulary belongs to another descriptor"},
    {"no_pictures", 409, "there is nothing to train a vocabulary from (of a job)"},
    {"image_too_large", 413,
     "the picture has more pixels than --max-megapixels, or takes more memory than "
     "--max-decode-mb or more time than --decode-timeout to decode"},
    {"image_type_unknown", 415, "the bytes are no picture of a type that Pliant reads"},
    {"image_empty", 422, "the picture has no pixels"},
    {"image_too_small", 422, "the picture is too small to be described"},
    {"image_truncated", 422, "the picture ends too early"},
    {"image_corrupt", 422, "the picture is damaged, or its decoder did not survive it"},
    {"too_few_features", 422, "the picture, or its region, is too plain to be recognised"},
});

const ProblemCode* FindCode(const std::string& code) {
  const auto* it = std::find_if(kCodes.begin(), kCodes.end(),
                                [&](const ProblemCode& known) { return code == known.code; });
  return it == kCodes.end() ? nullptr : it;
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
  problem.code = problem.status == 503                  ? "busy"
                 : problem.status == 507                ? "no_space"
                 : error.code() == ErrorCode::kReadOnly ? "read_only"
                                                        : "internal";
  problem.detail = PublicDetail(problem.code);
  problem.internal = error.reason() + ": " + error.what();
  if (problem.status == 503) problem.retry_after_s = kDefaultRetryAfterS;
  return problem;
}

}  // namespace

std::span<const ProblemCode> ProblemCodes() { return kCodes; }
std::span<const ProblemCode> EngineProblemCodes() { return kEngineCodes; }

const ProblemCode& ProblemCodeOf(const std::string& code) {
  if (const ProblemCode* known = FindCode(code)) return *known;
  for (const ProblemCode& known : kEngineCodes) {
    if (code == known.code) return known;
  }
  throw std::logic_error("unlisted problem code " + code);
}

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

int StatusOf(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return 400;
    case ErrorCode::kNotFound:
      return 404;
    case ErrorCode::kConflict:
      return 409;
    case ErrorCode::kTooLarge:
      return 413;
    case ErrorCode::kUnsupportedMediaType:
      return 415;
    case ErrorCode::kUnprocessable:
      return 422;
    case ErrorCode::kUnavailable:
    case ErrorCode::kCancelled:
      return 503;
    case ErrorCode::kNoSpace:
      return 507;
    case ErrorCode::kReadOnly:
    case ErrorCode::kCorrupt:
    case ErrorCode::kInternal:
      return 500;
  }
  return 500;
}

Problem CurrentProblem() {
  try {
    throw;
  } catch (const ProblemError& error) {
    return error.problem();
  } catch (const Error& error) {
    return FromError(error);
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

Problem ProblemForStatus(int status) {
  switch (status) {
    case 404:
      return MakeProblem("route_not_found", "There is nothing at this path.");
    case 408:
      return MakeProblem("request_timeout", "The request did not arrive in time.");
    case 413:
      return MakeProblem("body_too_large", "The body is too large.");
    case 414:
      return MakeProblem("uri_too_long", "The address is too long.");
    case 416:
      return MakeProblem("range_not_satisfiable", "The Range header cannot be understood.");
    case 417:
      return MakeProblem("expectation_failed", "Only Expect: 100-continue is understood.");
    case 431:
      return MakeProblem("headers_too_large", "The headers are too large.");
    default:
      break;
  }
  if (status >= 500) {
    return {.status = 500,
            .code = "internal",
            .detail = PublicDetail("internal"),
            .internal = "the HTTP library answered " + std::to_string(status)};
  }
  return MakeProblem("bad_request", "The request is not valid HTTP.");
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
  if (problem.retry_after_s > 0) {
    response.headers.emplace_back("Retry-After", std::to_string(problem.retry_after_s));
  }
  return response;
}

std::string StatusTitle(int status) {
  static const std::map<int, std::string> titles = {
      {400, "Bad Request"},
      {401, "Unauthorized"},
      {403, "Forbidden"},
      {404, "Not Found"},
      {405, "Method Not Allowed"},
      {408, "Request Timeout"},
      {409, "Conflict"},
      {411, "Length Required"},
      {412, "Precondition Failed"},
      {413, "Content Too Large"},
      {414, "URI Too Long"},
      {415, "Unsupported Media Type"},
      {416, "Range Not Satisfiable"},
      {417, "Expectation Failed"},
      {421, "Misdirected Request"},
      {422, "Unprocessable Content"},
      {429, "Too Many Requests"},
      {431, "Request Header Fields Too Large"},
      {500, "Internal Server Error"},
      {501, "Not Implemented"},
      {503, "Service Unavailable"},
      {507, "Insufficient Storage"},
  };
  const auto it = titles.find(status);
  return it == titles.end() ? "Error" : it->second;
}

}  // namespace pliant::server
