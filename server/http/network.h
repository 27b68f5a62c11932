// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Addresses and networks of IP, both versions.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include <sys/socket.h>

namespace pliant::server {

// The bytes of an IPv6 address; of an IPv4 address as mapped into IPv6 (RFC 4291, 2.5.5.2).
using IpAddress = std::array<std::uint8_t, 16>;

inline constexpr IpAddress kMappedIp4 = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};
inline constexpr int kBitsBeforeIp4 = 96;

// Nothing for other families.
std::optional<IpAddress> IpAddressOf(const sockaddr* address);
// "192.0.2.1" or "2001:db8::1", also with a zone ("fe80::1%eth0"), which is ignored.
std::optional<IpAddress> IpAddressOf(const std::string& text);
std::string TextOf(const IpAddress& address);  // in its shortest form

struct IpNetwork {
  IpAddress base = {};
  int bits = 0;

  bool Contains(const IpAddress& address) const;
};

// An address, or "ADDRESS/BITS" (CIDR).
std::optional<IpNetwork> IpNetworkOf(const std::string& text);

}  // namespace pliant::server
