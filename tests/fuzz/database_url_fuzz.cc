// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// URLs of clusters. What may be a password is in no message.
#include <algorithm>

#include "index/files/text.h"
#include "index/store/clickhouse/database_url.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::clickhouse::DatabaseUrl;
using pliant::clickhouse::ParseDatabaseUrl;
using pliant::fuzz::Require;

constexpr std::size_t kLeastSecret = 8;

// Between the first : behind the scheme and the last @.
std::string SecretOf(std::string_view text) {
  const std::size_t scheme = text.find("://");
  const std::size_t at = text.rfind('@');
  if (scheme == std::string_view::npos || at == std::string_view::npos) return "";
  const std::size_t colon = text.find(':', scheme + 3);
  if (colon == std::string_view::npos || colon + 1 >= at) return "";
  return std::string(text.substr(colon + 1, at - colon - 1));
}

// What a message repeats of the input.
std::string QuotedIn(const std::string& message) {
  const std::size_t first = message.find('"');
  const std::size_t last = message.rfind('"');
  return first == last ? "" : message.substr(first + 1, last - first - 1);
}

void CheckUrl(const DatabaseUrl& url) {
  Require(!url.hosts.empty() && !url.database.empty() && !url.cluster.empty(),
          "there are hosts, a database and a cluster");
  for (const auto* hosts : {&url.hosts, &url.keepers}) {
    for (const auto& host : *hosts) {
      Require(!host.host.empty() && host.port >= 1 && host.port <= 65535, "a host has a port");
      Require(host.host.find_first_of("@/?#%'\\ \"<>") == std::string::npos, "a host is a name");
    }
  }
  for (const std::string& name : {url.database, url.cluster}) {
    Require(name.find_first_of("'`\\/.;- ()") == std::string::npos, "names need no quotes in SQL");
  }
  Require(ParseDatabaseUrl(url.Text()) == url, "what is written is read");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(pliant::fuzz::TextOf({data, size}));
  DatabaseUrl url;
  try {
    url = ParseDatabaseUrl(text);
  } catch (const pliant::Error& error) {
    Require(error.code() == pliant::ErrorCode::kInvalidArgument &&
                error.reason() == "database_url_invalid",
            "the URL is to blame");
    const std::string message = error.what();
    Require(pliant::IsValidUtf8(message), "a message is UTF-8");
    const std::string said = QuotedIn(message);
    const std::string secret = SecretOf(text);
    for (std::size_t at = 0; at + kLeastSecret <= secret.size(); ++at) {
      Require(said.find(secret.substr(at, kLeastSecret)) == std::string::npos,
              "no message has a part of a password");
    }
    return 0;
  }
  CheckUrl(url);
  return 0;
}
