// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/forwarded.h"

#include <algorithm>
#include <optional>

#include "descriptor/base/error.h"
#include "descriptor/base/strings.h"
#include "index/files/text.h"
#include "server/http/form.h"

namespace pliant::server {

namespace {

// The elements of all fields of that name. A comma in quotes separates, too: else the open quote of
// a client could swallow what its proxy added.
std::vector<std::string> ElementsOf(const Request& request, const std::string& name) {
  std::vector<std::string> elements;
  const auto [begin, end] = request.headers.equal_range(name);
  for (auto field = begin; field != end; ++field) {
    for (const std::string& one : Split(field->second, ',')) elements.emplace_back(Trimmed(one));
  }
  return elements;
}

std::string LastOf(const Request& request, const std::string& name) {
  const std::vector<std::string> elements = ElementsOf(request, name);
  return elements.empty() ? "" : elements.back();
}

// Of "192.0.2.1", "192.0.2.1:80", "2001:db8::1" or "[2001:db8::1]:80"; nothing for other names.
std::optional<IpAddress> AddressOfNode(std::string node) {
  if (node.starts_with('[')) {
    const std::size_t end = node.find(']');
    if (end == node.npos) return std::nullopt;
    node = node.substr(1, end - 1);
  } else if (std::count(node.begin(), node.end(), ':') == 1) {
    node.erase(node.find(':'));
  }
  return IpAddressOf(node);
}

}  // namespace

TrustedProxies::TrustedProxies(const std::vector<std::string>& networks) {
  for (const std::string& text : networks) {
    const auto network = IpNetworkOf(text);
    if (!network) {
      throw Error(ErrorCode::kInvalidArgument, "trusted_proxies_invalid",
                  "'" + text + "' is no address or network like 127.0.0.1 or 10.0.0.0/8");
    }
    networks_.push_back(*network);
  }
}

bool TrustedProxies::Contain(const std::string& address) const {
  const auto bytes = networks_.empty() ? std::nullopt : IpAddressOf(address);
  return bytes && std::any_of(networks_.begin(), networks_.end(),
                              [&](const IpNetwork& one) { return one.Contains(*bytes); });
}

void TrustedProxies::Apply(Request& request) const {
  if (!Contain(request.remote_address)) return;
  std::string proto = LastOf(request, "X-Forwarded-Proto");
  std::string host = LastOf(request, "X-Forwarded-Host");
  const bool is_list = request.headers.contains("X-Forwarded-For");
  const auto hops = ElementsOf(request, is_list ? "X-Forwarded-For" : "Forwarded");
  for (auto hop = hops.rbegin(); hop != hops.rend() && Contain(request.remote_address); ++hop) {
    const std::string pairs = ";" + *hop;
    const auto address = AddressOfNode(is_list ? *hop : FieldParameter(pairs, "for"));
    if (!is_list) {
      proto = FieldParameter(pairs, "proto");
      host = FieldParameter(pairs, "host");
    }
    if (!address) break;
    request.remote_address = TextOf(*address);
  }
  request.is_https = EqualsIgnoringCase(proto, "https");
  if (!host.empty()) {
    request.headers.erase("Host");
    request.headers.emplace("Host", host);
  }
  std::string prefix = LastOf(request, "X-Forwarded-Prefix");
  if (prefix.ends_with('/')) prefix.pop_back();
  if (!prefix.empty() && IsBasePath(prefix)) request.base_path = prefix;
}

bool IsBasePath(const std::string& text) {
  return text.empty() ||
         (text.starts_with('/') && !text.ends_with('/') && text.find("//") == text.npos &&
          text.find("/.") == text.npos && IsNameOf(text, "/-._~"));
}

}  // namespace pliant::server
