// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What stops browsers from using this server for pages of other sites: the names that the server
// can be called by, cross-site requests, and CORS (Fetch standard).
#pragma once

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/http/message.h"

namespace pliant::server {

// Which names a request can call this server by. A page of another site can point its own DNS name
// at this machine (DNS rebinding); the browser then takes the server for part of that site, and
// only the Host header tells. Addresses need no check: a browser that asks by address asked no DNS.
// Immutable.
class AllowedHosts {
 public:
  // Beside IP addresses and `localhost`: `listen_host` when it is a name, the machine's own host
  // name, and `more` (names without port; "*" = any).
  AllowedHosts(const std::string& listen_host, const std::vector<std::string>& more);

  // `host` is the value of a Host header: HOST or HOST:PORT, IPv6 addresses in brackets. The port
  // does not matter. False for what is malformed.
  bool Allows(const std::string& host) const;

 private:
  bool any_ = false;
  std::set<std::string> names_;  // lower case, without a final dot
};

// Immutable.
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
