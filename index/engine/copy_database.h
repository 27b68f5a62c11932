// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// All that a database holds, copied into another one, each a file or a URL. Nothing is described
// anew.
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
  std::filesystem::path to;    // made when it does not exist
  int commit_every = 250;      // images that are written in one commit, or as many as 64 MiB hold
  std::function<void(std::uint64_t done, std::uint64_t total)> progress;  // images; one at a time
  std::stop_token stop;
};

struct CopyResult {
  std::uint64_t collections = 0;
  std::uint64_t copied = 0;     // images
  std::uint64_t unchanged = 0;  // that were there already
  std::uint64_t extra = 0;      // that are in `to` and not in `from`; they stay
  std::uint64_t without_content =
      0;                           // of `copied`: whose uploaded bytes were not kept, or are lost
  std::uint64_t vocabularies = 0;  // that were copied
  std::uint64_t keys = 0;          // API keys that were copied
};

// Images with their ids, objects, metadata, times, features and bytes; collections with their
// names and aliases; vocabularies; API keys. Jobs are left behind. What is there already with the
// same bytes, object, metadata and source is no work, so that a copy that was interrupted goes on.
// Changes of `from` meanwhile may be missing: copy again. Throws kConflict "model_mismatch" for
// databases of different descriptors, kInvalidArgument "same_database", kCancelled "cancelled", and
// what both databases throw.
CopyResult CopyDatabase(const CopyOptions& options);

struct RankingsCompared {
  std::uint64_t compared = 0;            // queries
  std::vector<std::string> differences;  // a sentence each
};

// Asks both for images of `from`, at most `count`, as queries: the same ten images must come,
// with the same scores up to 1e-5.
RankingsCompared CompareRankings(Engine& from, Engine& to, std::uint64_t count);

}  // namespace pliant
