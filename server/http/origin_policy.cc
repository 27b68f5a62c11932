// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/origin_policy.h"

#include <array>
#include <climits>

#include <arpa/inet.h>
#include <unistd.h>

#include "descriptor/base/strings.h"
#include "server/http/network.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

bool IsAddress(int family, const std::string& text) {
  const bool is_ip4 = text.find(':') == std::string::npos;
  return is_ip4 == (family == AF_INET) && text.find('%') == std::string::npos &&
         IpAddressOf(text).has_value();
}

// DNS names have no case, and a final dot says only that they are complete (RFC 1034, 3.1).
std::string Normalized(std::string name) {
  name = Lower(name);
  if (name.ends_with('.')) name.pop_back();
  return name;
}

std::string MachineName() {
  std::array<char, HOST_NAME_MAX + 1> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

// Without ":PORT"; unchanged where that is malformed.
std::string WithoutPort(const std::string& host) {
  constexpr std::size_t kMostDigits = 5;
  const std::size_t end = host.find_last_not_of("0123456789");
  const bool is_port =
      end != std::string::npos && host[end] == ':' && host.size() - end - 1 <= kMostDigits;
  return is_port ? host.substr(0, end) : host;
}

}  // namespace

AllowedHosts::AllowedHosts(const std::string& listen_host, const std::vector<std::string>& more)
    : names_{"localhost", Normalized(listen_host), Normalized(MachineName())} {
  for (const std::string& name : more) names_.insert(Normalized(name));
  names_.erase("");
}

bool AllowedHosts::Allows(const std::string& host) const {
  if (names_.contains("*")) return true;
  const std::string name = WithoutPort(host);
  if (name.starts_with('[')) {
    return name.ends_with(']') && IsAddress(AF_INET6, name.substr(1, name.size() - 2));
  }
  return IsAddress(AF_INET, name) || names_.contains(Normalized(name));
}

bool OriginPolicy::Allows(const std::string& origin) const {
  return !origin.empty() && (allowed_.contains("*") || allowed_.contains(origin));
}

bool OriginPolicy::IsPreflight(const Request& request) const {
  return request.method == "OPTIONS" && Allows(request.header("Origin")) &&
         request.headers.contains("Access-Control-Request-Method");
}

Response OriginPolicy::PreflightAnswer(const std::string& methods) {
  return {.status = 204,
          .headers = {{"Access-Control-Allow-Methods", methods},
                      {"Access-Control-Allow-Headers",
                       "Authorization, X-API-Key, Content-Type, Idempotency-Key, If-Match, "
                       "If-None-Match, If-Range, Range, X-Request-Id"},
                      {"Access-Control-Max-Age", "600"}}};
}

void OriginPolicy::CheckSameSite(const Request& request) const {
  if (request.method == "GET") return;
  const std::string site = request.header("Sec-Fetch-Site");
  const std::string origin = request.header("Origin");
  // A browser that says so itself knows better than a Host header, which a proxy can change.
  if (Allows(origin) || site == "same-origin") return;
  const bool same_origin = origin.empty() || origin == "http://" + request.header("Host") ||
                           origin == "https://" + request.header("Host");
  if (site == "cross-site" || site == "same-site" || !same_origin) {
    throw ProblemError("cross_site", "Pages of other sites need permission (--cors-origins).");
  }
}

std::vector<std::pair<std::string, std::string>> OriginPolicy::Headers(
    const Request& request) const {
  std::vector<std::pair<std::string, std::string>> headers;
  if (!allowed_.empty()) headers.emplace_back("Vary", "Origin");
  const std::string origin = request.header("Origin");
  const bool allowed = Allows(origin);
  headers.emplace_back("Cross-Origin-Resource-Policy", allowed ? "cross-origin" : "same-origin");
  if (!allowed) return headers;
  headers.emplace_back("Access-Control-Allow-Origin", origin);
  headers.emplace_back(
      "Access-Control-Expose-Headers",
      "Content-Range, ETag, Idempotency-Replayed, Link, Location, RateLimit-Limit, "
      "RateLimit-Remaining, RateLimit-Reset, Retry-After, X-Request-Id");
  return headers;
}

}  // namespace pliant::server
