// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Adds many picture files to the index: several threads, one picture each.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "index/cli/interrupt.h"
#include "index/engine/engine.h"
#include "index/files/picture_files.h"

namespace pliant::cli {

struct IndexJobOptions {
  std::string collection = kDefaultCollection;
  int jobs = 0;  // threads; 0 = one per core
  std::int64_t max_bytes = 0;
};

struct IndexJobResult {
  std::uint64_t indexed = 0;
  std::uint64_t unchanged = 0;
  std::vector<SkippedFile> skipped;  // by file name
  bool interrupted = false;
};

// An error of one picture (unreadable, not a picture, too few features) skips that picture. An
// error that affects all (disk full, database busy or damaged, model mismatch) ends the job and is
// thrown. Everything counted as indexed is durable.
IndexJobResult RunIndexJob(Engine& engine, const std::vector<PictureFile>& files,
                           const IndexJobOptions& options, const Interrupt& interrupt);

}  // namespace pliant::cli
