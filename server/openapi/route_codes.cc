// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/openapi/route_codes.h"

#include <algorithm>

namespace pliant::server {

namespace {

using Codes = std::set<std::string>;

bool Answers(const Route& route, int status) {
  return std::any_of(route.answers.begin(), route.answers.end(),
                     [&](const Answer& answer) { return answer.status == status; });
}

void AddBodyCodes(const Route& route, Codes& codes) {
  if (route.body == BodyKind::kNone) return;
  codes.insert({"body_too_large", "unsupported_content_type", "unsupported_content_encoding",
                "unsupported_transfer_encoding"});
  const bool images_in_json = route.body == BodyKind::kImageOrJson || route.body == BodyKind::kPair;
  if (route.body == BodyKind::kJson || images_in_json) {
    codes.insert("invalid_json");
  }
  if (route.body == BodyKind::kMergePatch) {
    codes.insert({"invalid_json", "missing_parameter", "invalid_parameter", "unknown_parameter"});
  }
  if (images_in_json) {
    codes.insert({"invalid_parameter", "fetch_off", "fetch_host_not_allowed", "fetch_failed"});
  }
  if (!images_in_json) return;
  if (route.scope >= Scope::kWrite) codes.insert("same_bytes");
  codes.insert({"missing_parameter", "duplicate_parameter", "image_type_unknown", "image_empty",
                "image_truncated", "image_corrupt", "image_too_small", "image_too_large",
                "too_few_features"});
}

void AddParameterCodes(const Route& route, Codes& codes) {
  codes.insert("unknown_parameter");
  for (const Parameter& parameter : route.parameters) {
    codes.insert({"invalid_parameter", "duplicate_parameter"});
    if (parameter.required) codes.insert("missing_parameter");
    if (parameter.name == "cursor") codes.insert("invalid_cursor");
    if (parameter.type == Parameter::Type::kJson || parameter.type == Parameter::Type::kJsonList ||
        parameter.type == Parameter::Type::kImage) {
      codes.insert("invalid_json");
    }
  }
}

void AddScopeCodes(const Route& route, Codes& codes) {
  if (route.scope != Scope::kPublic)
    codes.insert({"unauthorized", "forbidden", "rate_limited", "starting", "database_unavailable",
                  "database_outcome_unknown"});
  if (route.scope >= Scope::kWrite) codes.insert({"no_space", "read_only"});
}

}  // namespace

bool HasEtag(const Route& route) { return Answers(route, 304); }
bool TakesRange(const Route& route) { return Answers(route, 206); }

std::set<std::string> RouteCodes(const Route& route) {
  // What any request may meet, whatever it asks for.
  Codes codes = {"bad_request", "uri_too_long",          "headers_too_large", "request_timeout",
                 "internal",    "range_not_satisfiable", "host_not_allowed",  "busy"};
  AddScopeCodes(route, codes);
  AddBodyCodes(route, codes);
  AddParameterCodes(route, codes);
  if (route.method != "GET") codes.insert({"cross_site", "precondition_failed"});
  if (HeedsIdempotencyKey(route)) {
    codes.insert({"invalid_parameter", "idempotency_running", "idempotency_other"});
  }
  if (HasEtag(route)) codes.insert("precondition_failed");
  if (route.needs_index) codes.insert({"starting", "stopping"});
  const bool in_collection = route.pattern.starts_with("/v1/collections/{c}");
  const bool makes_it = route.pattern == "/v1/collections/{c}" && route.method == "PUT";
  if (in_collection && !makes_it) codes.insert("collection_not_found");
  codes.insert(route.codes.begin(), route.codes.end());
  return codes;
}

}  // namespace pliant::server
