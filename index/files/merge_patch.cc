// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/merge_patch.h"

#include <nlohmann/json.hpp>

#include "index/files/text.h"

namespace pliant {

std::string MergeMetadata(const std::string& metadata, const std::string& patch) {
  if (patch == "null") return "{}";
  nlohmann::json merged = nlohmann::json::parse(metadata);
  merged.merge_patch(nlohmann::json::parse(CanonicalMetadata(patch)));
  return CanonicalMetadata(merged.dump());
}

}  // namespace pliant
