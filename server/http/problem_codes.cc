// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which problems there are, and their statuses.
#include <algorithm>
#include <array>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr std::array kCodes = std::to_array<ProblemCode>({
    {"bad_request", 400,
     "the request is not valid HTTP, or its body does not match its Content-Type"},
    {"invalid_parameter", 400, "a parameter has an invalid value (`parameter` names it)"},
    {"unknown_parameter", 400, "this route has no such parameter (`parameter` names it)"},
    {"missing_parameter", 400, "a required parameter is missing (`parameter` names it)"},
    {"duplicate_parameter", 400, "a parameter was given twice (`parameter` names it)"},
    {"invalid_cursor", 400, "invalid cursor for this list; start again without a cursor"},
    {"invalid_json", 400,
     "the JSON does not parse, is nested too deep, has a name twice or more than 1000 names in "
     "one object, or is not an object"},
    {"unauthorized", 401, "the key is missing or invalid"},
    {"forbidden", 403, "the scope of the key does not allow this"},
    {"cross_site", 403, "a page of another site tried to change something"},
    {"route_not_found", 404, "no route has this path"},
    {"collection_not_found", 404, "no collection has this name"},
    {"alias_not_found", 404, "no alias has this name"},
    {"image_not_found", 404, "no image has this id"},
    {"object_not_found", 404, "no image shows this object"},
    {"vocabulary_not_found", 404, "no vocabulary has this number"},
    {"job_not_found", 404, "no job has this id, or the server has deleted its record"},
    {"backup_not_found", 404, "no backup has this name"},
    {"key_not_found", 404, "no valid key has this id"},
    {"method_not_allowed", 405, "the path exists, but not with this method (see Allow)"},
    {"request_timeout", 408, "the request did not arrive in time"},
    {"no_vocabulary", 409, "the collection has no vocabulary yet; the detail says what to do"},
    {"imports_off", 409, "the server has no --import-dir"},
    {"backups_off", 409, "the server has no --backup-dir"},
    {"backup_exists", 409, "a backup with this name exists"},
    {"fetch_off", 409, "the server fetches no images (--fetch-hosts)"},
    {"first_key_admin", 409, "the first key must have the scope admin"},
    {"last_admin_key", 409, "the last key of scope admin cannot be revoked over HTTP"},
    {"idempotency_running", 409, "the first request with this Idempotency-Key is still running"},
    {"interrupted", 409,
     "the server stopped during the job, and the job cannot continue (of a job)"},
    {"precondition_failed", 412,
     "the resource does not meet If-Match or If-None-Match; read it again"},
    {"body_too_large", 413,
     "the body is larger than --max-body-mb, or an import than --max-import-mb"},
    {"uri_too_long", 414, "the address is too long"},
    {"unsupported_content_type", 415, "this route does not accept this Content-Type"},
    {"unsupported_content_encoding", 415, "the server does not accept compressed bodies"},
    {"range_not_satisfiable", 416, "the Range header is invalid or outside of the file"},
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
});

constexpr std::array kEngineCodes = std::to_array<ProblemCode>({
    {"content_not_kept", 404, "the server did not store the uploaded bytes (--keep-originals)"},
    {"collection_permanent", 409, "the collection `default` cannot be deleted"},
    {"collection_is_alias", 409, "delete the collection by its own name, not by an alias"},
    {"collection_exists", 409, "an alias cannot have the name of a collection"},
    {"same_bytes", 409,
     "the collection has these bytes as an image with another object or other metadata"},
    {"object_exists", 409, "another object has this name; `merge=true` merges the two"},
    {"model_mismatch", 409, "the vocabulary belongs to another descriptor"},
    {"no_images", 409, "there are no images to train a vocabulary from (of a job)"},
    {"image_too_large", 413,
     "the image exceeds --max-megapixels, --max-decode-mb or --decode-timeout"},
    {"image_type_unknown", 415, "the bytes are not an image of a supported type"},
    {"image_empty", 422, "the image has no pixels"},
    {"image_too_small", 422, "the image is too small to be described"},
    {"image_truncated", 422, "the image ends too early"},
    {"image_corrupt", 422, "the image is damaged, or it crashed its decoder"},
    {"too_few_features", 422, "the image, or its region, has too few keypoints to be recognised"},
});

}  // namespace

std::span<const ProblemCode> ProblemCodes() { return kCodes; }
std::span<const ProblemCode> EngineProblemCodes() { return kEngineCodes; }

const ProblemCode& ProblemCodeOf(const std::string& code) {
  for (const auto codes : {ProblemCodes(), EngineProblemCodes()}) {
    for (const ProblemCode& known : codes) {
      if (code == known.code) return known;
    }
  }
  throw std::logic_error("unlisted problem code " + code);
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

std::string StatusTitle(int status) {
  // Not a map: threads may ask until the program's very end.
  constexpr std::pair<int, const char*> kTitles[] = {
      {200, "OK"},
      {201, "Created"},
      {202, "Accepted"},
      {204, "No Content"},
      {206, "Partial Content"},
      {207, "Multi-Status"},
      {304, "Not Modified"},
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
  const auto title = std::find_if(std::begin(kTitles), std::end(kTitles),
                                  [status](const auto& one) { return one.first == status; });
  return title == std::end(kTitles) ? "Error" : title->second;
}

}  // namespace pliant::server
