// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/merge_patch.h"

#include <utility>

#include <nlohmann/json.hpp>

#include "index/files/names.h"
#include "index/files/owned_json.h"

namespace pliant {
namespace {

using Json = nlohmann::json;

// RFC 7396, with what `patch` holds moved out of it. As Json::merge_patch, but nothing that is
// replaced needs memory to go.
void Merge(Json* target, Json* patch) {
  if (!patch->is_object()) {
    OwnedJson::TakeApart(target);
    *target = std::move(*patch);
    return;
  }
  if (!target->is_object()) {
    OwnedJson::TakeApart(target);
    *target = Json::object();
  }
  for (const auto& [key, value] : patch->items()) {
    if (!value.is_null()) {
      Merge(&(*target)[key], &value);
    } else if (const auto old = target->find(key); old != target->end()) {
      OwnedJson::TakeApart(&*old);
      target->erase(old);
    }
  }
}

}  // namespace

std::string MergeMetadata(const std::string& metadata, const std::string& patch) {
  if (patch == "null") return "{}";
  OwnedJson merged(nlohmann::json::parse(metadata));
  OwnedJson changes(nlohmann::json::parse(CanonicalMetadata(patch)));
  Merge(&*merged, &*changes);
  return CanonicalMetadata(merged->dump());
}

}  // namespace pliant
