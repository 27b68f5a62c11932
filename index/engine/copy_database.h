// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Copies the content of a database into another one, each a file or a URL. Images are not described
// again.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "index/engine/engine.h"

namespace pliant {

struct CopyOptions {
  std::filesystem::path from;  // files or URLs (database_url.h)
  std::filesystem::path to;    // created if it does not exist
  int commit_every = 250;      // images per commit, 1 to 1000, but at most 64 MiB
  std::function<void(std::uint64_t done, std::uint64_t total)> progress;  // images; one at a time
  std::stop_token stop;
};

struct CopyResult {
  std::uint64_t collections = 0;
  std::uint64_t copied = 0;           // images
  std::uint64_t unchanged = 0;        // images that were there already
  std::uint64_t extra = 0;            // images in `to` that `from` does not have; they stay
  std::uint64_t without_content = 0;  // of `copied`: images without their uploaded bytes
  std::uint64_t vocabularies = 0;
  std::uint64_t keys = 0;  // API keys
};

// Images with their ids, objects, metadata, times, features and bytes; collections with their names
// and aliases; vocabularies; API keys. Jobs are not copied. Images that exist with the same bytes,
// object, metadata and source are skipped, so that an interrupted copy can continue. Changes of
// `from` during the copy can be missing: copy again. Throws kConflict "model_mismatch" for
// databases with different descriptors, kInvalidArgument "same_database", kCancelled "cancelled",
// and what both databases throw.
CopyResult CopyDatabase(const CopyOptions& options);

struct RankingsCompared {
  std::uint64_t compared = 0;            // queries
  std::vector<std::string> differences;  // one sentence each
};

// Searches both databases with at most `count` images of `from`. Both must return the same ten
// images, with scores that differ by at most 1e-5.
RankingsCompared CompareRankings(Engine& from, Engine& to, std::uint64_t count);

}  // namespace pliant
