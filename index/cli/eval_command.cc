// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant eval matching | retrieval | tracking: each benchmark adds itself.
#include "index/cli/command.h"

namespace pliant::cli {

void AddEvalCommand(CLI::App& program, ExitStatus& status) {
  CLI::App* app = program.add_subcommand("eval", "Evaluate descriptors on a data set");
  app->require_subcommand(1);
  app->footer("Example:  pliant eval matching scenes/");
  AddEvalMatching(*app, status);
  AddEvalRetrieval(*app, status);
  AddEvalTracking(*app, status);
}

}  // namespace pliant::cli
