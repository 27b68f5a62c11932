// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/network.h"

#include <algorithm>
#include <cstring>

#include <arpa/inet.h>
#include <netinet/in.h>

#include "descriptor/base/strings.h"

namespace pliant::server {

std::optional<IpAddress> IpAddressOf(const sockaddr* address) {
  IpAddress bytes = kMappedIp4;
  if (address->sa_family == AF_INET) {
    sockaddr_in v4{};
    std::memcpy(&v4, address, sizeof v4);
    std::memcpy(bytes.data() + kBitsBeforeIp4 / 8, &v4.sin_addr, sizeof v4.sin_addr);
    return bytes;
  }
  if (address->sa_family != AF_INET6) return std::nullopt;
  sockaddr_in6 v6{};
  std::memcpy(&v6, address, sizeof v6);
  std::memcpy(bytes.data(), &v6.sin6_addr, bytes.size());
  return bytes;
}

std::optional<IpAddress> IpAddressOf(const std::string& text) {
  IpAddress address = kMappedIp4;
  if (text.find('\0') != text.npos) return std::nullopt;  // inet_pton() reads up to a zero
  if (inet_pton(AF_INET, text.c_str(), address.data() + kBitsBeforeIp4 / 8) == 1) return address;
  const std::string without_zone = text.substr(0, text.find('%'));
  if (inet_pton(AF_INET6, without_zone.c_str(), address.data()) == 1) return address;
  return std::nullopt;
}

std::string TextOf(const IpAddress& address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  const bool is_ip4 = IpNetwork{kMappedIp4, kBitsBeforeIp4}.Contains(address);
  return inet_ntop(is_ip4 ? AF_INET : AF_INET6, address.data() + (is_ip4 ? kBitsBeforeIp4 / 8 : 0),
                   text.data(), text.size());
}

bool IpNetwork::Contains(const IpAddress& address) const {
  const int whole = bits / 8;
  const int mask = 0xff00 >> bits % 8 & 0xff;  // of the byte that a network has a part of
  return std::equal(base.begin(), base.begin() + whole, address.begin()) &&
         (mask == 0 || (address[whole] & mask) == (base[whole] & mask));
}

std::optional<IpNetwork> IpNetworkOf(const std::string& text) {
  const std::size_t slash = std::min(text.find('/'), text.size());
  const auto base = IpAddressOf(text.substr(0, slash));
  if (!base) return std::nullopt;
  const int before = text.substr(0, slash).find(':') == text.npos ? kBitsBeforeIp4 : 0;
  const int most = 8 * static_cast<int>(base->size()) - before;
  if (slash == text.size()) return IpNetwork{*base, before + most};
  const auto bits = NumberOf<int>(text.substr(slash + 1));
  if (!bits || *bits < 0 || *bits > most) return std::nullopt;
  return IpNetwork{*base, before + *bits};
}

}  // namespace pliant::server
