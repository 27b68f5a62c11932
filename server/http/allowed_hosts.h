// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which names a request may call this server by. A page of another site can point its own DNS name
// at this machine (DNS rebinding); the browser then takes the server for part of that site, and
// only the Host header tells. Addresses need no check: a browser that asks by address asked no DNS.
#pragma once

#include <set>
#include <string>
#include <vector>

namespace pliant::server {

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

}  // namespace pliant::server
