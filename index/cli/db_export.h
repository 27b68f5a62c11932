// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant db export
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "index/cli/command.h"
#include "index/engine/engine.h"

namespace pliant::cli {

struct ExportOptions {
  // .npz (engine/collection_npz.h): features, by ids; .ndjson: the records, a line of JSON each.
  std::filesystem::path out;
  std::string collection;
  std::optional<std::string> object;  // only its pictures
  std::string filter;                 // only those whose metadata pass
  bool json = false;
};

// Throws kInvalidArgument "bad_export_name" for another extension.
void CheckExportName(const std::filesystem::path& out);

// Replaces the file, by pictures that are all of one state of the database.
ExitStatus RunExport(Engine& engine, const ExportOptions& options);

}  // namespace pliant::cli
