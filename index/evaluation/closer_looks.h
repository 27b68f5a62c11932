// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Closer looks at queries (Engine::DescribeFiner), kept as files: every vocabulary and protocol
// asks for those of the same pictures.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "index/engine/engine.h"

namespace pliant {

class CloserLooks {
 public:
  // What lies in `folder` already is taken to be of this engine's way to describe pictures. Made
  // when first needed.
  CloserLooks(Engine* engine, std::filesystem::path folder);

  // Of the query `id` in `file`, whose first look is `known`. Throws what DescribeFiner throws,
  // kCorrupt for a damaged file of the folder, kNoSpace "folder_unwritable".
  std::optional<Features> Of(const std::string& id, const std::filesystem::path& file,
                             std::int64_t max_bytes, const Features& known);

 private:
  Engine& engine_;
  std::filesystem::path folder_;
};

}  // namespace pliant
