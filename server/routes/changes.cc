// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/changes.h"

#include <algorithm>

#include <fmt/format.h>

#include "descriptor/base/sha256.h"
#include "descriptor/image/image.h"
#include "server/http/conditions.h"
#include "server/http/json.h"
#include "server/http/parameters.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"

namespace pliant::server {

namespace {

constexpr std::size_t kEtagDigits = 32;

std::string EtagOfText(const std::string& text) {
  const Bytes bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  return '"' + Sha256Hex(bytes).substr(0, kEtagDigits) + '"';
}

}  // namespace

std::string EtagOf(const Json& record) { return EtagOfText(ToText(record)); }

Response TaggedResponse(const Json& json) {
  Response response = JsonResponse(json);
  response.headers.emplace_back("ETag", EtagOfText(response.body));
  for (auto& [name, value] : response.headers) {
    if (name == "Cache-Control") value = "private, no-cache";
  }
  return response;
}

Response RecordResponse(const Json& record) {
  Response response = JsonResponse(record);
  response.headers.emplace_back("ETag", EtagOf(record));
  return response;
}

void CheckIfMatch(const Request& request, const Json& record) {
  if (IfMatchHolds(request, EtagOf(record))) return;
  throw ProblemError("precondition_failed",
                     "It has been changed since: what is stored is not what If-Match names.");
}

void CheckConditionsOf(const Request& request, const Json& record_or_null) {
  const bool there = !record_or_null.is_null();
  if (!there && request.headers.contains("If-Match")) {
    throw ProblemError("precondition_failed", "There is nothing that If-Match could name.");
  }
  if (!there) return;
  CheckIfMatch(request, record_or_null);
  if (!NamedByIfNoneMatch(request, EtagOf(record_or_null)).empty()) {
    throw ProblemError("precondition_failed", "There is already what If-None-Match names.");
  }
}

std::optional<std::string> TextIn(const Json& patch, const std::string& name) {
  const auto it = patch.find(name);
  if (it == patch.end()) return std::nullopt;
  if (it->is_null()) return "";
  if (!it->is_string()) ThrowInvalid(name, name + " must be text or null.");
  return it->get<std::string>();
}

Json MergePatchOf(const Request& request, const std::vector<std::string>& fields) {
  if (request.body.empty()) {
    throw ProblemError("missing_parameter", "The body must be a JSON merge patch.")
        .Parameter("body");
  }
  Json patch = ParseJsonObject(request.body, "body");
  for (const auto& [name, value] : patch.items()) {
    if (fields.empty() || std::find(fields.begin(), fields.end(), name) != fields.end()) continue;
    throw ProblemError("unknown_parameter",
                       fmt::format("'{}' cannot be changed here. What can: {}.", name.substr(0, 64),
                                   fmt::join(fields, ", ")))
        .Parameter(name.substr(0, 64));
  }
  return patch;
}

}  // namespace pliant::server
