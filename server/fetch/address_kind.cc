// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/fetch/address_kind.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

#include <arpa/inet.h>
#include <netinet/in.h>

#include "descriptor/base/strings.h"

namespace pliant::server {

namespace {

using Kind = AddressKind;
using Bytes16 = std::array<std::uint8_t, 16>;

struct Network4 {
  std::uint32_t base;
  int bits;
  Kind kind;
};

constexpr std::uint32_t Ip(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  return a << 24 | b << 16 | c << 8;
}

// All others are public.
constexpr Network4 kNetworks4[] = {
    {Ip(0, 0, 0), 8, Kind::kNever},         // this network
    {Ip(10, 0, 0), 8, Kind::kPrivate},      //
    {Ip(100, 64, 0), 10, Kind::kPrivate},   // shared by providers' customers (CGNAT)
    {Ip(127, 0, 0), 8, Kind::kPrivate},     // loopback
    {Ip(169, 254, 0), 16, Kind::kNever},    // link-local
    {Ip(172, 16, 0), 12, Kind::kPrivate},   //
    {Ip(192, 0, 0), 24, Kind::kNever},      // of protocols
    {Ip(192, 0, 2), 24, Kind::kNever},      // of documents
    {Ip(192, 88, 99), 24, Kind::kNever},    // relays of 6to4
    {Ip(192, 168, 0), 16, Kind::kPrivate},  //
    {Ip(198, 18, 0), 15, Kind::kNever},     // of benchmarks
    {Ip(198, 51, 100), 24, Kind::kNever},   // of documents
    {Ip(203, 0, 113), 24, Kind::kNever},    // of documents
    {Ip(224, 0, 0), 4, Kind::kNever},       // multicast
    {Ip(240, 0, 0), 4, Kind::kNever},       // reserved, and broadcast
};

struct Network6 {
  std::array<std::uint8_t, 6> base;
  int bits;
  Kind kind;
};

// The first that fits; all others are kNever.
constexpr Network6 kNetworks6[] = {
    {{0xfc}, 7, Kind::kPrivate},                   // unique local
    {{0x20, 0x01, 0x00}, 23, Kind::kNever},        // of protocols: Teredo, ORCHID
    {{0x20, 0x01, 0x0d, 0xb8}, 32, Kind::kNever},  // of documents
    {{0x20, 0x02}, 16, Kind::kNever},              // 6to4: leads to an IPv4 address
    {{0x3f, 0xff, 0x00}, 20, Kind::kNever},        // of documents
    {{0x20}, 3, Kind::kPublic},
};

Kind KindOf4(std::uint32_t address) {
  for (const Network4& network : kNetworks4) {
    const std::uint32_t mask = ~std::uint32_t{0} << (32 - network.bits);
    if ((address & mask) == network.base) return network.kind;
  }
  return Kind::kPublic;
}

bool StartsWith(const Bytes16& address, const std::uint8_t* base, int bits) {
  const int whole = bits / 8;
  if (!std::equal(base, base + whole, address.begin())) return false;
  const int rest = bits % 8;
  const int mask = 0xff << (8 - rest) & 0xff;
  return rest == 0 || (address[whole] & mask) == (base[whole] & mask);
}

Kind KindOf6(const Bytes16& address) {
  constexpr Bytes16 kLoopback = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
  constexpr Bytes16 kMapped = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};
  constexpr Bytes16 kNat64 = {0, 0x64, 0xff, 0x9b};
  constexpr int kBeforeIp4 = 96;
  const std::uint32_t inside = std::uint32_t{address[12]} << 24 | std::uint32_t{address[13]} << 16 |
                               std::uint32_t{address[14]} << 8 | std::uint32_t{address[15]};
  if (address == kLoopback) return Kind::kPrivate;
  if (StartsWith(address, kMapped.data(), kBeforeIp4)) return KindOf4(inside);
  if (StartsWith(address, kNat64.data(), kBeforeIp4)) {
    return KindOf4(inside) == Kind::kPublic ? Kind::kPublic : Kind::kNever;
  }
  for (const Network6& network : kNetworks6) {
    if (StartsWith(address, network.base.data(), network.bits)) return network.kind;
  }
  return Kind::kNever;
}

}  // namespace

std::string CanonicalHost(std::string host) {
  host = Lower(host);
  if (host.size() < 2 || host.front() != '[' || host.back() != ']') return host;
  in6_addr address{};
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (inet_pton(AF_INET6, host.substr(1, host.size() - 2).c_str(), &address) != 1) return host;
  return "[" + std::string(inet_ntop(AF_INET6, &address, text.data(), text.size())) + "]";
}

AddressKind KindOf(const sockaddr* address) {
  if (address->sa_family == AF_INET) {
    sockaddr_in v4{};
    std::memcpy(&v4, address, sizeof v4);
    return KindOf4(ntohl(v4.sin_addr.s_addr));
  }
  if (address->sa_family == AF_INET6) {
    sockaddr_in6 v6{};
    std::memcpy(&v6, address, sizeof v6);
    Bytes16 bytes{};
    std::memcpy(bytes.data(), v6.sin6_addr.s6_addr, bytes.size());
    return KindOf6(bytes);
  }
  return Kind::kNever;
}

}  // namespace pliant::server
