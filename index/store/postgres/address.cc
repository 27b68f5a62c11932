// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/postgres/address.h"

#include <map>
#include <memory>

#include <libpq-fe.h>

#include "descriptor/base/error.h"

namespace pliant::postgres {

Address ParseAddress(const std::string& url) {
  char* message = nullptr;
  const std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)> options(
      PQconninfoParse(url.c_str(), &message), &PQconninfoFree);
  PQfreemem(message);  // it may quote a password
  if (!options) {
    throw Error(
        ErrorCode::kInvalidArgument, "database_url_invalid",
        "the URL of the database is not valid; write "
        "postgresql://USER@HOST:PORT/DATABASE, with %XX for special characters, and put the "
        "password into PGPASSWORD or ~/.pgpass");
  }
  std::map<std::string, std::string> values;
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->val != nullptr) values[option->keyword] = option->val;
  }
  Address address;
  address.url = url;
  address.shown = "postgresql://" + values["host"];
  if (!values["port"].empty()) address.shown += ":" + values["port"];
  address.shown += "/" + values["dbname"];
  const std::string& attributes = values["target_session_attrs"];
  address.reads_on_standby = attributes == "any" || attributes == "read-only" ||
                             attributes == "standby" || attributes == "prefer-standby";
  return address;
}

}  // namespace pliant::postgres
