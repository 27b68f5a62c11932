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

#include "index/files/text.h"
#include "server/http/json.h"

namespace pliant::server {

namespace {

constexpr int kDefaultRetryAfterS = 1;
constexpr std::size_t kMostDetailBytes = 2048;
constexpr std::size_t kMostParameterBytes = 128;
constexpr std::string_view kInvalidSuffix = "_invalid";

constexpr std::array kCodes = std::to_array<ProblemCode>({
    // Of the server itself.
    {"bad_request", 400,
     "the request is not valid HTTP, or its body does not match its Content-Type"},
    {"invalid_parameter", 400, "a parameter has an invalid value (`parameter` names it)"},
    {"unknown_parameter", 400, "this route has no such parameter (`parameter` names it)"},
    {"missing_parameter", 400, "a required parameter is missing (`parameter` names it)"},
    {"duplicate_parameter", 400, "a parameter was given twice (`parameter` names it)"},
    {"invalid_cursor", 400, "invalid cursor for this list; start again without a cursor"},
    {"invalid_json", 400,
     "the JSON is invalid, nested too deep or not an object, or an object has a duplicate key or "
     "more than 1000 keys"},
    {"unauthorized", 401, "the key is missing or invalid"},
    {"forbidden", 403, "the scope of the key does not allow this"},
    {"cross_site", 403, "the request comes from a page of another site (--cors-origins)"},
    {"imports_off", 403, "the server has no --import-dir"},
    {"backups_off", 403, "the server has no --backup-dir"},
    {"fetch_off", 403, "the server does not fetch images (--fetch-hosts)"},
    {"route_not_found", 404, "no route has this path"},
    {"collection_not_found", 404, "no collection has this name"},
    {"alias_not_found", 404, "no alias has this name"},
    {"image_not_found", 404, "no image has this id"},
    {"object_not_found", 404, "no image shows this object"},
    {"vocabulary_not_found", 404, "no vocabulary has this number"},
    {"job_not_found", 404, "no job has this id, or the server has deleted its record"},
    {"backup_not_found", 404, "no backup has this name"},
    {"key_not_found", 404, "no valid key has this id"},
    {"method_not_allowed", 405, "this path does not support the method (see Allow)"},
    {"request_timeout", 408, "the request did not arrive in time"},
    {"no_vocabulary", 409, "the collection has no vocabulary yet; the detail says what to do"},
    {"backup_exists", 409, "a backup with this name exists"},
    {"first_key_admin", 409, "the first key must have the scope admin"},
    {"last_admin_key", 409, "the last key of scope admin cannot be revoked over HTTP"},
    {"idempotency_running", 409, "the first request with this Idempotency-Key is still running"},
    {"interrupted", 409,
     "the server stopped during the job, and the job cannot continue (of a job)"},
    {"precondition_failed", 412,
     "the resource does not meet If-Match or If-None-Match; read it again"},
    {"body_too_large", 413, "the body exceeds --max-body-mb, or an import exceeds --max-import-mb"},
    {"uri_too_long", 414, "the address is too long"},
    {"unsupported_content_type", 415, "this route does not accept this Content-Type"},
    {"unsupported_content_encoding", 415, "the server does not accept compressed bodies"},
    {"range_not_satisfiable", 416, "the range in the Range header is outside the file"},
    {"host_not_allowed", 421, "unknown host name in the Host header (--allowed-hosts)"},
    {"idempotency_other", 422,
     "this Idempotency-Key was already used for a different request in the last day"},
    {"rate_limited", 429, "more requests than --rate-limit allows; wait Retry-After seconds"},
    {"fetch_host_not_allowed", 422,
     "the server does not fetch from this host, or the host has no public address "
     "(--fetch-hosts, --fetch-private)"},
    {"fetch_failed", 422, "the server could not fetch the image at image_url; the detail says why"},
    {"headers_too_large", 431, "the headers are larger than --max-header-kb"},
    {"internal", 500, "a defect or damaged data; find the request id in the server's log"},
    {"unsupported_transfer_encoding", 501, "the server accepts only chunked transfer encoding"},
    {"busy", 503, "the server is busy; wait Retry-After seconds"},
    {"database_unavailable", 503, "the database server does not answer; try again later"},
    {"database_outcome_unknown", 503, "outcome unknown; check before retrying"},
    {"starting", 503, "the index is still loading"},
    {"stopping", 503, "the server is stopping"},
    {"read_only", 500, "the server cannot write to the directory or database"},
    {"no_space", 507, "the server's disk is full"},
    // Of the engine.
    {"part_unavailable", 503,
     "no server answers for a part of the index; try again, or search with partial=true"},
    {"part_elsewhere", 404, "another server holds this part (between servers)"},
    {"part_changed", 409, "the part has changed since it was asked (between servers)"},
    {"content_not_kept", 404, "the server did not store the uploaded bytes (--keep-originals)"},
    {"collection_permanent", 409, "the collection `default` cannot be deleted"},
    {"collection_is_alias", 409, "delete the collection by its own name, not by an alias"},
    {"collection_exists", 409, "an alias cannot have the name of a collection"},
    {"same_bytes", 409,
     "the collection already has this image with another object or other metadata"},
    {"image_exists", 409, "the other collection already has an image with this id"},
    {"object_exists", 409, "another object has this name; `merge=true` merges the two"},
    {"model_mismatch", 409, "the vocabulary belongs to another descriptor"},
    {"no_images", 409, "there are no images to train on or to test with (of a job)"},
    {"image_too_large", 413,
     "the image exceeds --max-megapixels, --max-decode-mb or --decode-timeout"},
    {"image_type_unknown", 415, "the bytes are not an image of a supported type"},
    {"image_empty", 422, "the image is empty (0 bytes)"},
    {"image_too_small", 422, "the image is too small to be described"},
    {"image_truncated", 422, "the image ends too early"},
    {"image_corrupt", 422, "the image is damaged, or it crashed its decoder"},
    {"too_few_features", 422, "the image, or its region, has too few keypoints to be recognised"},
});

// The value of the first pair with that key.
template <typename Key, typename Value, std::size_t kSize>
Value ValueOf(const std::pair<Key, Value> (&table)[kSize], const Key& key, Value otherwise) {
  for (const auto& [known, value] : table) {
    if (known == key) return value;
  }
  return otherwise;
}

const ProblemCode* FindCode(const std::string& code) {
  const auto it = std::find_if(kCodes.begin(), kCodes.end(),
                               [&](const ProblemCode& known) { return code == known.code; });
  return it == kCodes.end() ? nullptr : &*it;
}

Problem Completed(const std::string& code, const std::string& detail, Problem problem) {
  problem.status = ProblemCodeOf(code).status;
  problem.code = code;
  problem.detail = detail;
  if (problem.status == 503 && problem.retry_after_s == 0) {
    problem.retry_after_s = kDefaultRetryAfterS;
  }
  return problem;
}

// A failure on this side: clients learn no more than its code says.
Problem Hidden(const std::string& code, const std::string& internal) {
  constexpr std::pair<std::string_view, const char*> kDetails[] = {
      {"database_unavailable", "The database does not answer. Try again later."},
      {"database_outcome_unknown", "Outcome unknown. Check before retrying."},
      {"busy", "The server is busy. Try again shortly."},
      {"part_unavailable",
       "No server answers for a part of the index. Try again, or search with partial=true."},
      {"read_only", "The server cannot write to its directory or database."},
      {"no_space", "The server has no space left to store this."},
  };
  const char* detail = ValueOf<std::string_view, const char*>(
      kDetails, code, "Internal error. Find the cause in the server's log by the request id.");
  return Completed(code, detail, {.internal = internal});
}

int StatusOf(ErrorCode code) {
  constexpr std::pair<ErrorCode, int> kStatuses[] = {
      {ErrorCode::kInvalidArgument, 400},
      {ErrorCode::kNotFound, 404},
      {ErrorCode::kConflict, 409},
      {ErrorCode::kTooLarge, 413},
      {ErrorCode::kUnsupportedMediaType, 415},
      {ErrorCode::kUnprocessable, 422},
      {ErrorCode::kUnavailable, 503},
      {ErrorCode::kCancelled, 503},
      {ErrorCode::kNoSpace, 507},
  };
  return ValueOf(kStatuses, code, 500);
}

Problem FromError(const Error& error) {
  const int status = StatusOf(error.code());
  if (status >= 500) {
    const ProblemCode* known = FindCode(error.reason());
    const bool own = status == 503 && known != nullptr && known->status == 503;
    return Hidden(own                                    ? error.reason()
                  : status == 503                        ? "busy"
                  : status == 507                        ? "no_space"
                  : error.code() == ErrorCode::kReadOnly ? "read_only"
                                                         : "internal",
                  error.reason() + ": " + error.what());
  }
  Problem problem{.status = status, .code = error.reason(), .detail = error.what()};
  // The engine's "limit_invalid" is one code with a named parameter here.
  if (error.code() == ErrorCode::kInvalidArgument && problem.code.ends_with(kInvalidSuffix)) {
    problem.parameter = problem.code.substr(0, problem.code.size() - kInvalidSuffix.size());
    problem.code = "invalid_parameter";
  }
  return problem;
}

// An answer repeats no more of a request than people read.
Problem Bounded(Problem problem) {
  const auto bound = [](std::string& text, std::size_t most) {
    if (text.size() > most) text = Shown(text, most);
  };
  bound(problem.detail, kMostDetailBytes);
  bound(problem.parameter, kMostParameterBytes);
  return problem;
}

}  // namespace

std::span<const ProblemCode> ProblemCodes() { return kCodes; }

const ProblemCode& ProblemCodeOf(const std::string& code) {
  if (const ProblemCode* known = FindCode(code)) return *known;
  throw std::logic_error("unlisted problem code " + code);
}

ProblemError::ProblemError(const std::string& code, const std::string& detail, Problem more)
    : ProblemError(Completed(code, detail, std::move(more))) {}

ProblemError::ProblemError(Problem problem)
    : std::runtime_error(problem.code + ": " + problem.detail), problem_(std::move(problem)) {}

Problem CurrentProblem() {
  try {
    throw;
  } catch (const ProblemError& error) {
    return Bounded(error.problem());
  } catch (const Error& error) {
    return Bounded(FromError(error));
  } catch (const std::bad_alloc&) {
    return Hidden("busy", "out of memory");
  } catch (const std::exception& error) {
    return Hidden("internal", error.what());
  } catch (...) {
    return Hidden("internal", "an exception of an unknown type");
  }
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
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) response.headers.emplace_back(name, value);
  };
  add("Cache-Control", "no-store");
  add("WWW-Authenticate", problem.status == 401 ? "Bearer realm=\"pliant\"" : "");
  add("Allow", problem.allow);
  add("Content-Range", problem.content_range);
  add("Retry-After", problem.retry_after_s > 0 ? std::to_string(problem.retry_after_s) : "");
  return response;
}

std::string StatusTitle(int status) {
  // Not a map: threads can ask until the program's very end.
  constexpr std::pair<int, const char*> kTitles[] = {
      {200, "OK"},
      {201, "Created"},
      {202, "Accepted"},
      {204, "No Content"},
      {206, "Partial Content"},
      {207, "Multi-Status"},
      {304, "Not Modified"},
      {308, "Permanent Redirect"},
      {400, "Bad Request"},
      {401, "Unauthorized"},
      {403, "Forbidden"},
      {404, "Not Found"},
      {405, "Method Not Allowed"},
      {408, "Request Timeout"},
      {409, "Conflict"},
      {412, "Precondition Failed"},
      {413, "Content Too Large"},
      {414, "URI Too Long"},
      {415, "Unsupported Media Type"},
      {416, "Range Not Satisfiable"},
      {421, "Misdirected Request"},
      {422, "Unprocessable Content"},
      {429, "Too Many Requests"},
      {431, "Request Header Fields Too Large"},
      {500, "Internal Server Error"},
      {501, "Not Implemented"},
      {503, "Service Unavailable"},
      {507, "Insufficient Storage"},
  };
  return ValueOf<int, const char*>(kTitles, status, "Error");
}

}  // namespace pliant::server
