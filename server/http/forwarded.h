// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What reverse proxies tell about a client: Forwarded (RFC 7239), or X-Forwarded-For, -Proto, -Host
// and -Prefix. A client can send these as well, so they count only from trusted proxies.
#pragma once

#include <string>
#include <vector>

#include "server/http/message.h"
#include "server/http/network.h"

namespace pliant::server {

// Immutable.
class TrustedProxies {
 public:
  // Addresses and networks ("127.0.0.1", "10.0.0.0/8"). Throws Error kInvalidArgument
  // "trusted_proxies_invalid".
  explicit TrustedProxies(const std::vector<std::string>& networks);

  bool Contain(const std::string& address) const;

  // If remote_address is a trusted proxy: sets remote_address to the last address that is none,
  // is_https, base_path, and the Host header, as far as the proxies tell. X-Forwarded-For counts
  // before Forwarded. Other text in these headers is ignored.
  void Apply(Request& request) const;

 private:
  std::vector<IpNetwork> networks_;
};

// Whether the text is a path like "/pliant" or "/a/b", or empty.
bool IsBasePath(const std::string& text);

}  // namespace pliant::server
