// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Protection from pages of other sites in a browser: the server's host names, cross-site requests,
// and CORS (Fetch standard).
#pragma once

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/http/message.h"

namespace pliant::server {

// The host names of this server. A page of another site can point its own DNS name at this machine
// (DNS rebinding); the browser then takes the server for part of that site, and only the Host
// header tells. Addresses need no check: a browser that asks by address asked no DNS. Immutable.
class AllowedHosts {
 public:
  // IP addresses, `localhost`, `listen_host` when it is a name, the machine's own host name, and
  // `more` (names without port; "*" = any).
  AllowedHosts(const std::string& listen_host, const std::vector<std::string>& more);

  // `host` is a Host header: HOST or HOST:PORT, IPv6 addresses in brackets, with any port. False
  // for a malformed one.
  bool Allows(const std::string& host) const;

 private:
  std::set<std::string> names_;  // lower case, without a final dot; "*" = any
};

// Immutable.
class OriginPolicy {
 public:
  // Origins whose pages can send requests ("https://shop.example"); "*" = any.
  explicit OriginPolicy(const std::vector<std::string>& allowed)
      : allowed_(allowed.begin(), allowed.end()) {}

  // Whether a browser asks what a page can send here.
  bool IsPreflight(const Request& request) const;
  // `methods`: those of the path, comma-separated.
  static Response PreflightAnswer(const std::string& methods);

  // A page of another site can make a browser send requests here; they must not change anything.
  // Throws ProblemError "cross_site".
  void CheckSameSite(const Request& request) const;

  // Headers of every answer.
  std::vector<std::pair<std::string, std::string>> Headers(const Request& request) const;

 private:
  bool Allows(const std::string& origin) const;

  std::set<std::string> allowed_;
};

}  // namespace pliant::server
