// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/database_url.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <set>

#include "descriptor/base/error.h"
#include "index/files/text.h"

namespace pliant::clickhouse {
namespace {

constexpr std::string_view kForm = "clickhouse://user@host:8123,host2:8123/pliant?keeper=zk1:2181";
constexpr std::size_t kMaxHosts = 1000;
constexpr std::size_t kMaxNameBytes = 64;

[[noreturn]] void Refuse(const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, "database_url_invalid",
              "the database's URL " + what + "; it looks like " + std::string(kForm));
}

bool IsLetterOrDigit(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

std::string Quoted(std::string_view text) { return "\"" + ToDisplayText(text) + "\""; }

// Databases and clusters are parts of statements and of paths: names that need no quotes.
std::string CheckedName(std::string_view name, const std::string& what) {
  if (name.empty()) Refuse("names no " + what);
  const bool first_is_digit = name[0] >= '0' && name[0] <= '9';
  const bool plain =
      std::all_of(name.begin(), name.end(), [](char c) { return IsLetterOrDigit(c) || c == '_'; });
  if (name.size() > kMaxNameBytes || first_is_digit || !plain) {
    Refuse("names the " + what + " " + Quoted(name) +
           ", but a name has letters, digits and _, no digit first, and at most 64 of them");
  }
  return std::string(name);
}

int ParsePort(std::string_view text, std::string_view host) {
  int port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc() || end != text.data() + text.size() || port < 1 || port > 65535) {
    // It is not quoted: user:password without @ looks like a host and its port.
    Refuse("gives the host " + Quoted(host) + " a port that is not 1 to 65535");
  }
  return port;
}

HostPort ParseHost(std::string_view text, int default_port) {
  if (text.empty()) Refuse("has an empty host in its list");
  std::string_view host = text;
  std::string_view port;
  bool has_port = false;
  if (text.front() == '[') {
    const std::size_t close = text.find(']');
    if (close == std::string_view::npos) Refuse("has a host with [ and without ]");
    host = text.substr(1, close - 1);
    const std::string_view rest = text.substr(close + 1);
    has_port = !rest.empty();
    if (has_port && rest.front() != ':') Refuse("has something between ] and the port");
    port = has_port ? rest.substr(1) : rest;
  } else if (const std::size_t colon = text.find(':'); colon != std::string_view::npos) {
    if (text.find(':', colon + 1) != std::string_view::npos) {
      Refuse("has a host with several colons, which begins with " + Quoted(text.substr(0, colon)) +
             ": write IPv6 as [::1]:8123");
    }
    has_port = true;
    host = text.substr(0, colon);
    port = text.substr(colon + 1);
  }
  const bool address = text.front() == '[';
  const bool plain = std::all_of(host.begin(), host.end(), [address](char c) {
    return IsLetterOrDigit(c) || c == '.' || (address ? c == ':' : c == '-' || c == '_');
  });
  if (host.empty() || !plain || host.size() > 253) {
    Refuse("has the host " + Quoted(host) + ", which is no name and no address");
  }
  return {std::string(host), has_port ? ParsePort(port, host) : default_port};
}

std::vector<HostPort> ParseHosts(std::string_view list, int default_port) {
  std::vector<HostPort> hosts;
  for (;;) {
    const std::size_t comma = list.find(',');
    HostPort host = ParseHost(list.substr(0, comma), default_port);
    if (std::find(hosts.begin(), hosts.end(), host) != hosts.end()) {
      Refuse("names " + host.Text() + " twice");
    }
    hosts.push_back(std::move(host));
    if (hosts.size() > kMaxHosts) Refuse("names more than 1000 hosts");
    if (comma == std::string_view::npos) return hosts;
    list.remove_prefix(comma + 1);
  }
}

std::string ParseUser(std::string_view text) {
  if (text.find(':') != std::string_view::npos) {
    Refuse(
        "has a password, which others could read in lists of processes: put it into "
        "PLIANT_DB_PASSWORD or a file");
  }
  const bool plain = std::all_of(text.begin(), text.end(), [](char c) {
    return IsLetterOrDigit(c) || c == '_' || c == '-' || c == '.';
  });
  if (text.empty() || !plain || text.size() > kMaxNameBytes) {
    Refuse("has a user whose name is empty or not of letters, digits and . _ -");
  }
  return std::string(text);
}

void ParseParameter(std::string_view pair, DatabaseUrl& url) {
  const std::size_t equals = pair.find('=');
  const std::string_view name = pair.substr(0, equals);
  const std::string_view value =
      equals == std::string_view::npos ? std::string_view() : pair.substr(equals + 1);
  if (name == "password") {
    Refuse("has a password: put it into PLIANT_DB_PASSWORD or a file");
  }
  if (value.empty() && (name == "keeper" || name == "cluster" || name == "ca")) {
    Refuse("has the parameter " + std::string(name) + " without a value");
  }
  if (name == "keeper") {
    url.keepers = ParseHosts(value, 2181);
  } else if (name == "cluster") {
    url.cluster = CheckedName(value, "cluster");
  } else if (name == "ca") {
    if (!url.tls) Refuse("has the parameter ca, which needs clickhouses://");
    url.ca_file = std::string(value);
  } else {
    Refuse("has the unknown parameter " + Quoted(name) + "; known are keeper, cluster and ca");
  }
}

void ParseParameters(std::string_view text, DatabaseUrl& url) {
  std::set<std::string_view> seen;
  for (;;) {
    const std::size_t end = text.find('&');
    const std::string_view pair = text.substr(0, end);
    const std::string_view name = pair.substr(0, pair.find('='));
    if (!seen.insert(name).second) Refuse("has the parameter " + Quoted(name) + " twice");
    ParseParameter(pair, url);
    if (end == std::string_view::npos) return;
    text.remove_prefix(end + 1);
  }
}

std::string Listed(const std::vector<HostPort>& hosts) {
  std::string text;
  for (const HostPort& host : hosts) text += (text.empty() ? "" : ",") + host.Text();
  return text;
}

}  // namespace

std::string HostPort::Text() const {
  const bool address = host.find(':') != std::string::npos;
  return (address ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

std::string DatabaseUrl::Text() const {
  std::string text = tls ? "clickhouses://" : "clickhouse://";
  if (!user.empty()) text += user + "@";
  text += Listed(hosts) + "/" + database + "?cluster=" + cluster;
  if (!keepers.empty()) text += "&keeper=" + Listed(keepers);
  if (!ca_file.empty()) text += "&ca=" + ca_file;
  return text;
}

DatabaseUrl ParseDatabaseUrl(std::string_view text) {
  DatabaseUrl url;
  constexpr std::string_view kPlain = "clickhouse://";
  constexpr std::string_view kTls = "clickhouses://";
  if (text.substr(0, kTls.size()) == kTls) {
    url.tls = true;
    text.remove_prefix(kTls.size());
  } else if (text.substr(0, kPlain.size()) == kPlain) {
    text.remove_prefix(kPlain.size());
  } else {
    Refuse("does not begin with clickhouse:// or clickhouses://");
  }
  if (std::any_of(text.begin(), text.end(), [](char c) { return c > 0 && c <= ' '; })) {
    Refuse("contains white space or a control character");
  }
  if (text.find('#') != std::string_view::npos) Refuse("contains #");
  const std::size_t question = text.find('?');
  if (question != std::string_view::npos && text.find('@', question) != std::string_view::npos) {
    Refuse("contains @ behind ?; a user stands before the hosts, and a password is no part of it");
  }
  const std::string_view before = text.substr(0, question);
  const std::size_t at = before.rfind('@');
  const std::size_t slash = before.find('/', at == std::string_view::npos ? 0 : at);
  if (slash == std::string_view::npos) Refuse("names no database after its hosts");
  std::string_view authority = before.substr(0, slash);
  if (at != std::string_view::npos) {
    url.user = ParseUser(authority.substr(0, at));
    authority.remove_prefix(at + 1);
  }
  if (authority.empty()) Refuse("names no host");
  url.hosts = ParseHosts(authority, url.tls ? 8443 : 8123);
  url.database = CheckedName(before.substr(slash + 1), "database");
  if (question != std::string_view::npos) ParseParameters(text.substr(question + 1), url);
  return url;
}

std::string ReadDatabasePassword(const std::string& file) {
  const char* variable = std::getenv("PLIANT_DB_PASSWORD");
  std::string password = variable == nullptr ? "" : variable;
  if (!file.empty()) {
    if (variable != nullptr) {
      throw Error(ErrorCode::kInvalidArgument, "password_unusable",
                  "the password is in PLIANT_DB_PASSWORD and in a file; leave one of them out");
    }
    std::ifstream stream(file, std::ios::binary);
    if (!std::getline(stream, password)) {
      throw Error(ErrorCode::kNotFound, "password_file_unreadable",
                  "the password's file " + ToDisplayText(file) + " is empty or cannot be read");
    }
    if (!password.empty() && password.back() == '\r') password.pop_back();
  }
  const auto control = [](char c) { return (c >= 0 && c < ' ') || c == 0x7f; };
  if (std::any_of(password.begin(), password.end(), control)) {
    throw Error(ErrorCode::kInvalidArgument, "password_unusable",
                "the database's password contains a control character");
  }
  return password;
}

}  // namespace pliant::clickhouse
