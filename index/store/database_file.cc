// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/database_file.h"

#include <string>

#include "descriptor/base/error.h"

namespace pliant {

void RequireDatabaseFile(const std::filesystem::path& path) {
  if (path.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "database_unnamed",
                "the name of the database is empty");
  }
  const std::string text = path.string();
  if (text.rfind("clickhouse:/", 0) != 0 && text.rfind("clickhouses:/", 0) != 0) return;
  throw Error(ErrorCode::kInvalidArgument, "database_is_a_cluster",
              "the database is the URL of a cluster, and this needs a database file: for clusters "
              "there are pliant cluster init, status and check today; pictures cannot be kept on "
              "one yet");
}

}  // namespace pliant
