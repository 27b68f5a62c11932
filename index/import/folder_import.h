// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Indexes many image files with several threads, one image each: for `pliant index` and the imports
// of the server.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "index/engine/engine.h"
#include "index/files/image_files.h"

namespace pliant {

struct FolderImportOptions {
  std::string collection = kDefaultCollection;
  int threads = 0;             // 0 = one per core; a single image gets all of them
  std::int64_t max_bytes = 0;  // of one image
  // A canonical path: files that a link leads out of it are skipped ("outside"), and names and
  // reasons are relative to it, so that they do not reveal its location. Empty = no such limit.
  std::filesystem::path root;
  std::stop_token stop;
  // Each can be empty, and is called from any of the threads. `skipped` also receives the files
  // that the search for images skipped.
  std::function<void(std::uint64_t done, std::uint64_t total)> progress;
  std::function<void(const SkippedFile&)> skipped;
  // Replaces Engine::Add, for callers that share the cores or wait while the database is busy.
  std::function<AddResult(const AddRequest&)> add;
};

struct FolderImportResult {
  std::uint64_t indexed = 0;
  std::uint64_t unchanged = 0;
  std::uint64_t system_files = 0;    // left out; see ImageFiles
  std::vector<SkippedFile> skipped;  // of the search for images, then by file name
  bool interrupted = false;          // stopped before the last one
};

// An error of one image (unreadable, not an image, too few features) skips it. An error that
// concerns all (disk full, database busy or damaged, model mismatch) ends the import and is thrown.
// Images counted as indexed are durable.
FolderImportResult ImportImages(Engine& engine, const ImageFiles& files,
                                const FolderImportOptions& options);

}  // namespace pliant
