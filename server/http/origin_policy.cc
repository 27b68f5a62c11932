// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/origin_policy.h"

#include <algorithm>

#include "server/http/problem.h"

namespace pliant::server {

bool OriginPolicy::Allows(const std::string& origin) const {
  return !origin.empty() && std::any_of(allowed_.begin(), allowed_.end(), [&](const auto& one) {
    return one == "*" || one == origin;
  });
}

bool OriginPolicy::IsPreflight(const Request& request) const {
  return request.method == "OPTIONS" && Allows(request.header("Origin")) &&
         request.headers.contains("Access-Control-Request-Method");
}

Response OriginPolicy::PreflightAnswer(const std::string& methods) {
  if (methods.empty()) throw ProblemError("route_not_found", "There is nothing at this path.");
  Response response;
  response.status = 204;
  response.headers = {{"Access-Control-Allow-Methods", methods},
                      {"Access-Control-Allow-Headers",
                       "Authorization, X-API-Key, Content-Type, Idempotency-Key, If-Match, "
                       "If-None-Match, If-Range, Range, X-Request-Id"},
                      {"Access-Control-Max-Age", "600"}};
  return response;
}

void OriginPolicy::CheckSameSite(const Request& request) const {
  if (request.method == "GET") return;
  const std::string site = request.header("Sec-Fetch-Site");
  const std::string origin = request.header("Origin");
  if (Allows(origin)) return;
  const bool same_origin = origin.empty() || origin == "http://" + request.header("Host") ||
                           origin == "https://" + request.header("Host");
  if (site == "cross-site" || site == "same-site" || !same_origin) {
    throw ProblemError("cross_site", "Requests from pages of other sites are not accepted.");
  }
}

std::vector<std::pair<std::string, std::string>> OriginPolicy::Headers(
    const Request& request) const {
  std::vector<std::pair<std::string, std::string>> headers;
  if (!allowed_.empty()) headers.emplace_back("Vary", "Origin");
  const std::string origin = request.header("Origin");
  if (!Allows(origin)) {
    headers.emplace_back("Cross-Origin-Resource-Policy", "same-origin");
    return headers;
  }
  headers.emplace_back("Access-Control-Allow-Origin", origin);
  headers.emplace_back("Access-Control-Expose-Headers",
                       "Content-Range, ETag, Idempotency-Replayed, Location, Retry-After, "
                       "X-Request-Id");
  headers.emplace_back("Cross-Origin-Resource-Policy", "cross-origin");
  return headers;
}

}  // namespace pliant::server
