// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// How a cluster is named:
//   clickhouse://user@host:8123,host2:8123/pliant?keeper=zk1:2181,zk2:2181&cluster=pliant
// (`clickhouses://`: TLS, port 8443). The password is never a part of it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace pliant::clickhouse {

struct HostPort {
  std::string host;  // a name or an address; IPv6 without brackets
  int port = 0;

  bool operator==(const HostPort&) const = default;
  std::string Text() const;  // "host:8123", "[::1]:8123"
};

struct DatabaseUrl {
  bool tls = false;
  std::string user;             // empty: ClickHouse's own, "default"
  std::vector<HostPort> hosts;  // of the HTTP interface; at least one
  std::string database;
  std::vector<HostPort> keepers;  // ZooKeeper or ClickHouse Keeper; may be empty
  std::string cluster = "pliant";
  std::string ca_file;  // certificates to trust (PEM); empty: the system's

  bool operator==(const DatabaseUrl&) const = default;
  std::string Text() const;
};

// Throws kInvalidArgument "database_url_invalid" with a sentence that names the wrong part, and
// never quotes what may be a password.
DatabaseUrl ParseDatabaseUrl(std::string_view text);

// PLIANT_DB_PASSWORD, or the first line of `file` unless its name is empty. Throws
// kInvalidArgument "password_unusable" for both at once and for control characters, kNotFound
// "password_file_unreadable".
std::string ReadDatabasePassword(const std::string& file);

}  // namespace pliant::clickhouse
