// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The operator's list of the hosts that pictures may be fetched from.
#pragma once

#include <string>
#include <vector>

namespace pliant::server {

// Immutable and thread-safe.
class FetchHosts {
 public:
  // Each "host", "*.suffix" (all names below it, not itself) or "*" (any), with ":port" behind it
  // for another port than 80 (http) and 443 (https); "[2001:db8::1]" for an IPv6 address. Throws
  // Error kInvalidArgument "fetch_hosts_invalid" naming the entry.
  explicit FetchHosts(const std::vector<std::string>& entries);

  bool empty() const { return entries_.empty(); }
  bool AllowsAny() const;  // there is a "*"
  // `scheme` is "http" or "https"; `host` in lower case, an IPv6 address in brackets.
  bool Allows(const std::string& scheme, const std::string& host, int port) const;

 private:
  struct Entry {
    std::string host;  // with a dot before it: a suffix; "*": any
    int port = 0;      // 0 = the scheme's own
  };
  std::vector<Entry> entries_;
};

}  // namespace pliant::server
