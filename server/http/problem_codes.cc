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
    {"bad_request", 400, "the request is not valid HTTP, or its body is not what its type says"},
    {"invalid_parameter", 400,
     "a parameter has a value that is not accepted (`parameter` names it)"},
    {"unknown_parameter", 400, "the route has no such parameter (`parameter` names it)"},
    {"missing_parameter", 400, "a required parameter is absent (`parameter` names it)"},
    {"duplicate_parameter", 400, "a parameter was given twice (`parameter` names it)"},
    {"invalid_cursor", 400, "the cursor was not made by this list with these parameters"},
    {"invalid_json", 400,
     "the JSON does not parse, is nested too deep, has a name twice or more than 1000 in one "
     "object, or is not an object"},
    {"unauthorized", 401, "a key is needed, or the one shown does not work"},
    {"forbidden", 403, "the scope of the key does not include this"},
    {"cross_site", 403, "a web page of another site tried to change something"},
    {"route_not_found", 404, "there is nothing at this path"},
    {"collection_not_found", 404, "no such collection"},
    {"alias_not_found", 404, "no such alias"},
    {"image_not_found", 404, "no picture of that id"},
    {"object_not_found", 404, "no picture of such an object"},
    {"vocabulary_not_found", 404, "no vocabulary of that number"},
    {"job_not_found", 404, "no such job, or it is long finished"},
    {"demo_not_found", 404, "no such demonstration object"},
    {"backup_not_found", 404, "no backup of that name"},
    {"key_not_found", 404, "no working key of that id"},
    {"method_not_allowed", 405, "the path exists, the method does not (Allow lists those that do)"},
    {"request_timeout", 408, "the request did not arrive in time"},
    {"no_vocabulary", 409, "nothing to search with yet; the detail says what to do"},
    {"imports_off", 409, "the operator has named no directory to import from"},
    {"backups_off", 409, "the operator has named no directory for backups"},
    {"backup_exists", 409, "there is a backup of that name"},
    {"fetch_off", 409, "the operator lets the server fetch no pictures"},
    {"first_key_admin", 409, "the first key must have the scope admin"},
    {"last_admin_key", 409, "the last key of scope admin cannot be revoked over HTTP"},
    {"idempotency_running", 409, "the request with this Idempotency-Key is still being done"},
    {"interrupted", 409, "the server ended while the job ran, and it cannot go on (of a job)"},
    {"precondition_failed", 412,
     "what is stored is not what If-Match or If-None-Match asks for: read it anew"},
    {"length_required", 411,
     "a body needs Content-Length or chunked transfer encoding; that of a backup Content-Length"},
    {"body_too_large", 413,
     "the body is larger than --max-body-mb, a backup than --max-backup-mb, an import than "
     "--max-import-mb"},
    {"uri_too_long", 414, "the address is too long"},
    {"unsupported_content_type", 415, "the Content-Type is none that the route takes"},
    {"unsupported_content_encoding", 415, "compressed bodies are not taken"},
    {"range_not_satisfiable", 416,
     "the Range header cannot be understood, or names what is not there"},
    {"expectation_failed", 417, "the Expect header asks for what the server does not do"},
    {"host_not_allowed", 421,
     "the Host header has a name that is none of the server's (--allowed-hosts)"},
    {"idempotency_other", 422,
     "another request had the Idempotency-Key within the last day: a key is good for one request"},
    {"rate_limited", 429, "more requests than --rate-limit allows; Retry-After says when to go on"},
    {"fetch_host_not_allowed", 422,
     "the operator lets no pictures be fetched from this host, or it has no public address "
     "(--fetch-hosts, --fetch-private)"},
    {"backup_invalid", 422,
     "what was sent is no database of this Pliant or an older one, or is damaged; the detail says "
     "which"},
    {"fetch_failed", 422, "the picture at image_url could not be fetched; the detail says why"},
    {"headers_too_large", 431, "the headers are larger than --max-header-kb"},
    {"internal", 500, "a defect or damaged data; the server's log has the request id"},
    {"unsupported_transfer_encoding", 501, "only chunked transfer encoding is taken"},
    {"busy", 503, "too much to do at the moment; Retry-After says when to come again"},
    {"database_unavailable", 503, "the database server does not answer; try again later"},
    {"database_outcome_unknown", 503,
     "the database server did not say whether it is done: look before trying again"},
    {"starting", 503, "the index is still loading"},
    {"stopping", 503, "the server is being stopped"},
    {"read_only", 500, "the server may not write where it keeps this"},
    {"no_space", 507, "the server's disk is full"},
});

constexpr std::array kEngineCodes = std::to_array<ProblemCode>({
    {"content_not_kept", 404, "the uploaded bytes were not stored (--keep-originals)"},
    {"collection_permanent", 409, "the collection `default` cannot be deleted"},
    {"collection_is_alias", 409, "only the collection itself can be deleted, not by an alias"},
    {"collection_exists", 409, "an alias cannot have the name of a collection"},
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
  const auto title = std::find_if(std::begin(kTitles), std::end(kTitles),
                                  [status](const auto& one) { return one.first == status; });
  return title == std::end(kTitles) ? "Error" : title->second;
}

}  // namespace pliant::server
