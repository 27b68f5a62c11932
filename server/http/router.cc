// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/router.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "descriptor/base/hex.h"
#include "descriptor/base/strings.h"
#include "index/files/text.h"
#include "index/json/record_csv.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr const char* kImageTypes = "image/*";

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
    const auto byte = FromHex(text.substr(i + 1, 2));
    if (!byte || byte->empty()) {
      throw ProblemError("bad_request", "The path has an invalid % escape.");
    }
    decoded += static_cast<char>(byte->front());
    i += 2;
  }
  if (!IsValidUtf8(decoded)) throw ProblemError("bad_request", "The path must be valid UTF-8.");
  return decoded;
}

// A body whose bytes must tell what it is: curl calls it a form, or nothing.
bool IsUnnamed(const Route& route, const Request& request) {
  const std::string& type = request.content_type;
  return route.body == BodyKind::kImageOrJson &&
         (type.empty() || type == "application/x-www-form-urlencoded");
}

[[noreturn]] void ThrowUnsupported(const Route& route, const std::string& type) {
  throw ProblemError(
      "unsupported_content_type",
      fmt::format("This route does not accept Content-Type {}. Send {}.",
                  type.empty() ? "(none)" : type, fmt::join(TypesOf(route.body), " or ")));
}

}  // namespace

bool IsChoice(const std::string& choice, std::string_view text) {
  constexpr std::string_view kAny = ".KEY";
  const std::size_t fixed = choice.ends_with(kAny) ? choice.size() - kAny.size() + 1 : 0;
  return fixed == 0
             ? choice == text
             : text.size() > fixed && text.starts_with(std::string_view(choice).substr(0, fixed));
}

std::vector<std::string> TypesOf(BodyKind body) {
  switch (body) {
    case BodyKind::kNone:
      break;
    case BodyKind::kJson:
      return {"application/json"};
    case BodyKind::kImageOrJson:
      return {kImageTypes, kFileType, "multipart/form-data", "application/json"};
    case BodyKind::kPair:
      return {"multipart/form-data", "application/json"};
    case BodyKind::kBulk:
      return {kNdjsonType, kTarType, kCsvType};
    case BodyKind::kFile:
      return {kFileType};
    case BodyKind::kMergePatch:
      return {"application/merge-patch+json", "application/json"};
  }
  return {};
}

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
  throw ProblemError("method_not_allowed",
                     "This path takes " + allowed + ", not " + request.method + ".",
                     {.allow = allowed});
}

std::string Router::AllowedMethods(const std::vector<std::string>& segments) const {
  std::set<std::string> methods;
  for (std::size_t i = 0; i < routes_.size(); ++i) {
    if (!Fits(patterns_[i], segments)) continue;
    methods.insert(routes_[i].method);
    if (routes_[i].method == "GET") methods.insert("HEAD");
  }
  if (methods.empty()) throw ProblemError("route_not_found", "Unknown path.");
  return fmt::format("{}", fmt::join(methods, ", "));
}

std::vector<std::string> SplitPath(std::string_view path) {
  if (path.empty() || path.front() != '/') {
    throw ProblemError("bad_request", "The path must begin with /.");
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

std::string EncodeSegment(std::string_view text) { return PercentEncode(text, "-._~"); }

void CheckContentType(const Route& route, const Request& request) {
  if (!request.has_body || route.body == BodyKind::kNone) return;
  const std::string& type = request.content_type;
  const std::vector<std::string> accepted = TypesOf(route.body);
  const bool fits = std::any_of(accepted.begin(), accepted.end(), [&](const std::string& one) {
    return type == one || (one == kImageTypes && type.starts_with("image/")) ||
           (one == kNdjsonType && IsNdjsonType(type));
  });
  if (!fits && !IsUnnamed(route, request)) ThrowUnsupported(route, type);
}

void NameContentType(const Route& route, Request& request) {
  constexpr std::size_t kLookedAtBytes = 64;
  if (!IsUnnamed(route, request)) return;
  const std::string_view begin = std::string_view(request.body).substr(0, kLookedAtBytes);
  const bool is_text = !begin.empty() && !HasControlCharacter(Trimmed(begin)) && IsValidUtf8(begin);
  if (is_text && !Trimmed(begin).starts_with('{')) ThrowUnsupported(route, request.content_type);
  request.content_type = is_text ? "application/json" : kFileType;
}

}  // namespace pliant::server
