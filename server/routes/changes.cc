// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/changes.h"

#include <algorithm>
#include <sstream>

#include <fmt/format.h>

#include "descriptor/base/sha256.h"
#include "server/http/json.h"
#include "server/http/problem.h"
#include "server/routes/common.h"

namespace pliant::server {

namespace {

constexpr std::size_t kEtagDigits = 32;

// Exactly one of the list; weak ones never match. Records' ETags have no commas in them.
bool Lists(const std::string& if_match, const std::string& etag) {
  std::istringstream list(if_match);
  for (std::string one; std::getline(list, one, ',');) {
    const std::size_t begin = one.find_first_not_of(" \t");
    if (begin == std::string::npos) continue;
    one = one.substr(begin, one.find_last_not_of(" \t") + 1 - begin);
    if (one == "*" || one == etag) return true;
  }
  return false;
}

}  // namespace

std::string EtagOf(const Json& record) {
  const std::string text = ToText(record);
  const Bytes bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  return '"' + Sha256Hex(bytes).substr(0, kEtagDigits) + '"';
}

Response RecordResponse(const Json& record) {
  Response response = JsonResponse(record);
  response.headers.emplace_back("ETag", EtagOf(record));
  return response;
}

void CheckIfMatch(const Request& request, const Json& record) {
  const auto [begin, end] = request.headers.equal_range("If-Match");
  if (begin == end) return;
  const bool matches = std::any_of(
      begin, end, [&](const auto& header) { return Lists(header.second, EtagOf(record)); });
  if (matches) return;
  throw ProblemError("precondition_failed",
                     "It has been changed since: what is stored is not what If-Match names.");
}

Json MergePatchOf(const Request& request, const std::vector<std::string>& fields) {
  if (request.body.empty()) {
    throw ProblemError("missing_parameter", "The body must be a JSON merge patch.")
        .Parameter("body");
  }
  Json patch = ParseJsonObject(request.body, "body");
  for (const auto& [name, value] : patch.items()) {
    if (std::find(fields.begin(), fields.end(), name) != fields.end()) continue;
    throw ProblemError("unknown_parameter",
                       fmt::format("'{}' cannot be changed here. What can: {}.", name.substr(0, 64),
                                   fmt::join(fields, ", ")))
        .Parameter(name.substr(0, 64));
  }
  return patch;
}

}  // namespace pliant::server
