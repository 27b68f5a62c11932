// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/router.h"

#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "descriptor/base/hex.h"
#include "descriptor/base/strings.h"
#include "index/files/text.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

bool IsCapture(const std::string& part) { return part.size() > 2 && part.front() == '{'; }

bool Fits(const std::vector<std::string>& pattern, const std::vector<std::string>& segments) {
  if (pattern.size() != segments.size()) return false;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    if (IsCapture(pattern[i]) ? segments[i].empty() : pattern[i] != segments[i]) return false;
  }
  return true;
}

std::string DecodeSegment(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded += text[i];
      continue;
    }
    const int high = i + 2 < text.size() ? HexValue(text[i + 1]) : -1;
    const int low = i + 2 < text.size() ? HexValue(text[i + 2]) : -1;
    if (high < 0 || low < 0) throw ProblemError("bad_request", "The path has a broken % escape.");
    decoded += static_cast<char>(high * 16 + low);
    i += 2;
  }
  if (!IsValidUtf8(decoded)) throw ProblemError("bad_request", "The path is not UTF-8.");
  return decoded;
}

}  // namespace

bool HeedsIdempotencyKey(const Route& route) {
  const bool changes = route.scope == Scope::kWrite || route.scope == Scope::kAdmin;
  return changes && (route.method == "POST" || route.method == "PATCH") &&
         route.name != "keys.create";
}

Router::Router(std::vector<Route> routes) : routes_(std::move(routes)) {
  std::set<std::string> seen;
  for (const Route& route : routes_) {
    if (!seen.insert(route.method + " " + route.pattern).second) {
      throw std::logic_error("two routes for " + route.method + " " + route.pattern);
    }
    patterns_.push_back(SplitPath(route.pattern));
  }
}

const Route& Router::Resolve(Request& request) const {
  for (std::size_t i = 0; i < routes_.size(); ++i) {
    if (routes_[i].method != request.method || !Fits(patterns_[i], request.segments)) continue;
    for (std::size_t j = 0; j < patterns_[i].size(); ++j) {
      const std::string& part = patterns_[i][j];
      if (IsCapture(part)) request.captures[part.substr(1, part.size() - 2)] = request.segments[j];
    }
    return routes_[i];
  }
  const std::string allowed = AllowedMethods(request.segments);
  if (allowed.empty()) throw ProblemError("route_not_found", "There is nothing at this path.");
  throw ProblemError("method_not_allowed", "This path takes " + allowed + ".").Allow(allowed);
}

std::string Router::AllowedMethods(const std::vector<std::string>& segments) const {
  std::set<std::string> methods;
  for (std::size_t i = 0; i < routes_.size(); ++i) {
    if (!Fits(patterns_[i], segments)) continue;
    methods.insert(routes_[i].method);
    if (routes_[i].method == "GET") methods.insert("HEAD");
  }
  return fmt::format("{}", fmt::join(methods, ", "));
}

std::vector<std::string> SplitPath(std::string_view path) {
  if (path.empty() || path.front() != '/') {
    throw ProblemError("bad_request", "The address must be a path that begins with /.");
  }
  std::vector<std::string> segments;
  std::size_t begin = 1;
  while (true) {
    const std::size_t end = path.find('/', begin);
    segments.push_back(DecodeSegment(path.substr(begin, end - begin)));
    if (end == std::string_view::npos) return segments;
    begin = end + 1;
  }
}

std::vector<std::string> SplitPattern(const std::string& pattern) {
  return Split(std::string_view(pattern).substr(1), '/');
}

std::string EncodeSegment(std::string_view text) { return PercentEncode(text, "-._~"); }

void CheckConditions(const Route& route, const Request& request) {
  if (request.method == "GET" || route.takes_if_match) return;
  if (request.headers.contains("If-Match")) {
    throw ProblemError("precondition_failed",
                       "If-Match is not understood here: nothing was changed.");
  }
}

void CheckContentType(const Route& route, const Request& request) {
  if (!request.has_body) return;
  const std::string& type = request.content_type;
  const bool image = type.starts_with("image/") || type == "application/octet-stream" ||
                     type == "multipart/form-data";
  const bool json = type == "application/json";
  switch (route.body) {
    case BodyKind::kNone:
      return;  // such a body is not read
    case BodyKind::kJson:
      if (json) return;
      throw ProblemError("unsupported_content_type", "The body must be application/json.");
    case BodyKind::kImageOrJson:
      if (image || json) return;
      throw ProblemError("unsupported_content_type",
                         "The body must be image/*, application/octet-stream, "
                         "multipart/form-data or application/json.");
    case BodyKind::kMergePatch:
      if (json || type == "application/merge-patch+json") return;
      throw ProblemError("unsupported_content_type",
                         "The body must be application/merge-patch+json or application/json.");
    case BodyKind::kBulk:
      if (IsNdjsonType(type) || type == kTarType) return;
      throw ProblemError("unsupported_content_type",
                         "The body must be application/x-ndjson or application/x-tar.");
    case BodyKind::kPair:
      if (type == "multipart/form-data" || json) return;
      throw ProblemError("unsupported_content_type",
                         "The body must be multipart/form-data or application/json.");
  }
}

}  // namespace pliant::server
