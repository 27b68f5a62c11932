// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Output of `pliant query --draw` and `--unwarp`.
#pragma once

#include <filesystem>
#include <string>

#include "index/engine/engine.h"

namespace pliant::cli {

struct QueryImageOptions {
  std::filesystem::path draw;    // PNG file; empty = none
  std::filesystem::path unwarp;  // PNG file for the best verified hit, else a folder for all
  std::string collection = kDefaultCollection;
  DecodeOptions decode;  // its limits; sizes and colour are set here
};

// Writes the requested images, from a result with explanations. false: no hit was verified, so
// there was nothing to unwarp (reported on standard error). Throws kNoSpace "write_failed".
bool WriteQueryImages(Engine& engine, Bytes query, const SearchResult& result,
                      const QueryImageOptions& options);

}  // namespace pliant::cli
