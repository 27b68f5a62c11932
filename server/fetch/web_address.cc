// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/fetch/web_address.h"

#include <algorithm>
#include <cctype>
#include <new>
#include <utility>

#include <arpa/inet.h>
#include <curl/curl.h>

#include "descriptor/base/error.h"
#include "server/fetch/address_kind.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMostBytes = 2048;

[[noreturn]] void ThrowInvalid(const std::string& why) {
  throw Error(ErrorCode::kInvalidArgument, "image_url_invalid", "image_url " + why);
}

bool IsHostCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '-' || c == '_';
}

// Whoever resolves it takes it for an IPv4 address, in one of the forms of inet_aton(). The library
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
  if (!std::all_of(host.begin(), host.end(), IsHostCharacter)) return false;
  in_addr address{};
  return !EndsInANumber(host) || inet_pton(AF_INET, host.c_str(), &address) == 1;
}

}  // namespace

WebAddress::WebAddress(const std::string& text)
    : WebAddress(Parts(curl_url(), curl_url_cleanup), text) {}

WebAddress WebAddress::Redirected(const std::string& location) const {
  return {Parts(curl_url_dup(parts_.get()), curl_url_cleanup), location};
}

WebAddress::WebAddress(Parts parts, const std::string& text) : parts_(std::move(parts)) {
  if (!parts_) throw std::bad_alloc();
  if (text.empty()) ThrowInvalid("is empty.");
  if (text.size() > kMostBytes) ThrowInvalid("is longer than 2048 bytes.");
  if (std::any_of(text.begin(), text.end(), [](unsigned char c) { return c < ' ' || c == 0x7f; })) {
    ThrowInvalid("has control characters.");
  }
  switch (curl_url_set(parts_.get(), CURLUPART_URL, text.c_str(),
                       CURLU_URLENCODE | CURLU_DISALLOW_USER)) {
    case CURLUE_OK:
      break;
    case CURLUE_USER_NOT_ALLOWED:
      ThrowInvalid("may not name a user.");
    default:
      ThrowInvalid("must be an address like https://images.example.org/mug.jpg.");
  }
  scheme_ = Part(CURLUPART_SCHEME);
  if (scheme_ != "http" && scheme_ != "https") ThrowInvalid("must begin with http:// or https://.");
  host_ = CanonicalHost(Part(CURLUPART_HOST));
  if (host_.empty() || !IsHost(host_) || !Part(CURLUPART_ZONEID).empty()) {
    ThrowInvalid("must name its host in ASCII (xn--...) or by its address.");
  }
  if (Display().size() > kMostBytes) ThrowInvalid("is longer than 2048 bytes.");
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
