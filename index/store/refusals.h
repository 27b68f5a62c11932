// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The errors of all stores, one sentence each.
#pragma once

#include <cstdint>
#include <string>

#include "descriptor/base/error.h"
#include "index/records/records.h"

namespace pliant {

inline constexpr std::int64_t kSchemaVersion = 1;  // of the tables, in a file and on a server

namespace refusals {

// Throws kCorrupt "other_schema" unless `version` is kSchemaVersion. `database`: its name for
// people.
void CheckSchemaVersion(const std::string& database, std::int64_t version);

Error NoCollection(const std::string& name);  // kNotFound "collection_not_found"
// Throws NoCollection if the request means another collection of this name (collection_created_ms).
void CheckIsMeant(const AddRequest& request, std::int64_t created_ms);
Error NoImage(const std::string& collection, const std::string& id);  // "image_not_found"
Error FeaturesMissing();                                              // kCorrupt "features_missing"

}  // namespace refusals
}  // namespace pliant
