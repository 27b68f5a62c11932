// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A database's URL, as libpq understands it (PostgreSQL's manual, "Connection URIs"), with its
// environment variables and files. Private to store/postgres.
#pragma once

#include <string>

namespace pliant::postgres {

struct Address {
  std::string url;
  std::string shown;  // for people: hosts, database, schema; no user's secrets
  // What reads may be done by a standby, if it has what is committed: target_session_attrs of the
  // URL is any, read-only, standby or prefer-standby.
  bool reads_on_standby = false;
};

// Throws kInvalidArgument "database_url_invalid" for what libpq does not understand. Its message
// has nothing of the URL that may be a password.
Address ParseAddress(const std::string& url);

}  // namespace pliant::postgres
