// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which pages of other sites may ask, and what a browser is told about it: CORS and cross-site
// requests (Fetch standard).
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "server/http/message.h"

namespace pliant::server {

// Immutable, so safe from any thread.
class OriginPolicy {
 public:
  // Origins whose pages may ask ("https://shop.example"); "*" = any.
  explicit OriginPolicy(std::vector<std::string> allowed) : allowed_(std::move(allowed)) {}

  // A browser's question what a page may send here.
  bool IsPreflight(const Request& request) const;
  // Its answer. `methods`: those of the path, comma-separated; throws "route_not_found" when empty.
  static Response PreflightAnswer(const std::string& methods);

  // A page of another site may make a browser send requests here; they must not change anything.
  // Throws "cross_site".
  void CheckSameSite(const Request& request) const;

  // What every answer says about pages of other sites.
  std::vector<std::pair<std::string, std::string>> Headers(const Request& request) const;

 private:
  bool Allows(const std::string& origin) const;

  std::vector<std::string> allowed_;
};

}  // namespace pliant::server
