// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/fetch/fetch_hosts.h"

#include <algorithm>
#include <regex>

#include "descriptor/base/error.h"
#include "descriptor/base/strings.h"
#include "server/fetch/address_kind.h"

namespace pliant::server {

namespace {

constexpr int kLargestPort = 65535;

int PortOf(const std::string& scheme) { return scheme == "https" ? 443 : 80; }

}  // namespace

FetchHosts::FetchHosts(const std::vector<std::string>& entries) {
  static const std::regex form(
      R"((\*|(?:\*\.)?[a-z0-9_](?:[a-z0-9_.\-]*[a-z0-9_])?|\[[0-9a-f:.]+\])(?::([0-9]{1,5}))?)");
  for (const std::string& text : entries) {
    std::smatch parts;
    const std::string lower = Lower(text);
    const bool fits = std::regex_match(lower, parts, form);
    const int port = fits && parts[2].matched ? std::stoi(parts[2]) : 0;
    if (!fits || port > kLargestPort || (parts[2].matched && port == 0)) {
      throw Error(ErrorCode::kInvalidArgument, "fetch_hosts_invalid",
                  "hosts to fetch from must be names like images.example.org, *.shop.example or "
                  "images.example.org:8443, with commas between, or *, not '" +
                      text + "'");
    }
    std::string host = CanonicalHost(parts[1]);
    if (host.starts_with("*.")) host.erase(0, 1);
    entries_.push_back({std::move(host), port});
  }
}

bool FetchHosts::AllowsAny() const {
  return std::any_of(entries_.begin(), entries_.end(),
                     [](const Entry& entry) { return entry.host == "*"; });
}

bool FetchHosts::Allows(const std::string& scheme, const std::string& host, int port) const {
  return std::any_of(entries_.begin(), entries_.end(), [&](const Entry& entry) {
    if (port != (entry.port == 0 ? PortOf(scheme) : entry.port)) return false;
    if (entry.host == "*") return true;
    if (entry.host.front() != '.') return entry.host == host;
    return host.size() > entry.host.size() && host.ends_with(entry.host);
  });
}

}  // namespace pliant::server
