// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant db check, and how the commands of pliant db open a database.
#pragma once

#include "index/cli/command.h"
#include "index/engine/engine.h"

namespace pliant::cli {

enum class Access { kRead, kWrite };

// An existing database, as it is, without its descriptor. `with_index`: its size is to be told.
Engine OpenForCare(EngineOptions& options, Access access, bool with_index = false);

struct CheckOptions {
  bool sweep = false;  // also remove originals that no image refers to
  bool json = false;
};

// Verifies the integrity of the database that `engine` names, and prints what is wrong.
ExitStatus RunCheck(EngineOptions& engine, const CheckOptions& options);

}  // namespace pliant::cli
