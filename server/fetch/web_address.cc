// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/fetch/web_address.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <new>
#include <utility>

#include <arpa/inet.h>
#include <curl/curl.h>
#include <netinet/in.h>

#include "descriptor/base/error.h"
#include "descriptor/base/strings.h"
#include "index/files/text.h"
#include "server/http/network.h"

namespace pliant::server {

namespace {

using Kind = AddressKind;

constexpr IpNetwork kNat64 = {{0, 0x64, 0xff, 0x9b}, kBitsBeforeIp4};

struct Network {
  IpNetwork network;
  Kind kind;
};

constexpr Network Ip4(std::uint8_t a, std::uint8_t b, std::uint8_t c, int bits, Kind kind) {
  return {{{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff, a, b, c}, kBitsBeforeIp4 + bits}, kind};
}

// The first that contains an address counts; all others are kNever.
constexpr Network kNetworks[] = {
    Ip4(0, 0, 0, 8, Kind::kNever),         // this network
    Ip4(10, 0, 0, 8, Kind::kPrivate),      //
    Ip4(100, 64, 0, 10, Kind::kPrivate),   // shared by providers' customers (CGNAT)
    Ip4(127, 0, 0, 8, Kind::kPrivate),     // loopback
    Ip4(169, 254, 0, 16, Kind::kNever),    // link-local
    Ip4(172, 16, 0, 12, Kind::kPrivate),   //
    Ip4(192, 0, 0, 24, Kind::kNever),      // of protocols
    Ip4(192, 0, 2, 24, Kind::kNever),      // of documents
    Ip4(192, 88, 99, 24, Kind::kNever),    // relays of 6to4
    Ip4(192, 168, 0, 16, Kind::kPrivate),  //
    Ip4(198, 18, 0, 15, Kind::kNever),     // of benchmarks
    Ip4(198, 51, 100, 24, Kind::kNever),   // of documents
    Ip4(203, 0, 113, 24, Kind::kNever),    // of documents
    Ip4(224, 0, 0, 4, Kind::kNever),       // multicast
    Ip4(240, 0, 0, 4, Kind::kNever),       // reserved, and broadcast
    Ip4(0, 0, 0, 0, Kind::kPublic),
    {{{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1}, 128}, Kind::kPrivate},  // loopback
    {{{0xfc}, 7}, Kind::kPrivate},                                              // unique local
    {{{0x20, 0x01, 0x00}, 23}, Kind::kNever},        // of protocols: Teredo, ORCHID
    {{{0x20, 0x01, 0x0d, 0xb8}, 32}, Kind::kNever},  // of documents
    {{{0x20, 0x02}, 16}, Kind::kNever},              // 6to4: leads to an IPv4 address
    {{{0x3f, 0xff, 0x00}, 20}, Kind::kNever},        // of documents
    {{{0x20}, 3}, Kind::kPublic},
};

Kind KindOfBytes(const IpAddress& address) {
  if (kNat64.Contains(address)) {
    IpAddress mapped = kMappedIp4;
    std::copy(address.begin() + kBitsBeforeIp4 / 8, address.end(),
              mapped.begin() + kBitsBeforeIp4 / 8);
    return KindOfBytes(mapped) == Kind::kPublic ? Kind::kPublic : Kind::kNever;
  }
  for (const Network& network : kNetworks) {
    if (network.network.Contains(address)) return network.kind;
  }
  return Kind::kNever;
}

constexpr std::size_t kMostBytes = 2048;

[[noreturn]] void ThrowInvalid(const std::string& why) {
  throw Error(ErrorCode::kInvalidArgument, "image_url_invalid", "image_url " + why);
}

// A resolver takes such a host for an IPv4 address, in one of the forms of inet_aton(). The library
// has written these as four numbers, unless a part was percent-encoded.
bool EndsInANumber(std::string host) {
  if (host.ends_with('.')) host.pop_back();
  const std::string last = host.substr(host.rfind('.') + 1);
  const bool hexadecimal = last.starts_with("0x");
  return !last.empty() && last.find_first_not_of(hexadecimal ? "0123456789abcdef" : "0123456789",
                                                 hexadecimal ? 2 : 0) == std::string::npos;
}

// `host` is canonical. An IPv6 address is in brackets; the library has read it already.
bool IsHost(const std::string& host) {
  if (host.starts_with('[')) return true;
  if (!IsNameOf(host, ".-_")) return false;
  in_addr address{};
  return !EndsInANumber(host) || inet_pton(AF_INET, host.c_str(), &address) == 1;
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
  const auto bytes = IpAddressOf(address);
  return bytes ? KindOfBytes(*bytes) : Kind::kNever;
}

WebAddress::WebAddress(const std::string& text)
    : WebAddress(Parts(curl_url(), curl_url_cleanup), text) {}

WebAddress WebAddress::Redirected(const std::string& location) const {
  return {Parts(curl_url_dup(parts_.get()), curl_url_cleanup), location};
}

WebAddress::WebAddress(Parts parts, const std::string& text) : parts_(std::move(parts)) {
  if (!parts_) throw std::bad_alloc();
  if (text.empty()) ThrowInvalid("must not be empty.");
  if (text.size() > kMostBytes) ThrowInvalid("must have at most 2048 bytes.");
  if (HasControlCharacter(text)) ThrowInvalid("must not contain control characters.");
  const CURLUcode code = curl_url_set(parts_.get(), CURLUPART_URL, text.c_str(),
                                      CURLU_URLENCODE | CURLU_ALLOW_SPACE | CURLU_DISALLOW_USER);
  if (code == CURLUE_USER_NOT_ALLOWED) ThrowInvalid("must not contain a user name.");
  if (code != CURLUE_OK) {
    ThrowInvalid("must be a URL like https://images.example.org/mug.jpg.");
  }
  scheme_ = Part(CURLUPART_SCHEME);
  if (scheme_ != "http" && scheme_ != "https") ThrowInvalid("must begin with http:// or https://.");
  host_ = CanonicalHost(Part(CURLUPART_HOST));
  if (host_.empty() || !IsHost(host_) || !Part(CURLUPART_ZONEID).empty()) {
    ThrowInvalid("must have an ASCII host name (xn--...) or an IP address.");
  }
  if (Display().size() > kMostBytes) ThrowInvalid("must have at most 2048 bytes.");
  port_ = std::stoi(Part(CURLUPART_PORT, CURLU_DEFAULT_PORT));
}

std::string WebAddress::Part(CURLUPart which, unsigned flags) const {
  char* text = nullptr;
  if (curl_url_get(parts_.get(), which, &text, flags) != CURLUE_OK) return {};
  std::string part(text);
  curl_free(text);
  return part;
}

std::string WebAddress::Display() const {
  const std::string port = Part(CURLUPART_PORT, CURLU_NO_DEFAULT_PORT);
  return scheme_ + "://" + host_ + (port.empty() ? "" : ":" + port) + Part(CURLUPART_PATH);
}

}  // namespace pliant::server
