// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// `pliant cluster` of a build without PLIANT_CLICKHOUSE.
#include "index/cli/command.h"

namespace pliant::cli {

void AddClusterCommand(CLI::App& program, ExitStatus&) {
  CLI::App* app = program.add_subcommand("cluster", "Not in this build: ClickHouse clusters");
  app->prefix_command();
  app->callback([] {
    throw Error(ErrorCode::kInvalidArgument, "clusters_not_built",
                "this pliant was built without clusters (PLIANT_CLICKHOUSE=OFF)");
  });
}

}  // namespace pliant::cli
