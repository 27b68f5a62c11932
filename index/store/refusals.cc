// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/refusals.h"

#include "index/files/text.h"

namespace pliant::refusals {

void CheckSchemaVersion(const std::string& database, std::int64_t version) {
  if (version == kSchemaVersion) return;
  throw Error(ErrorCode::kCorrupt, "other_schema",
              "the database " + database + " has schema " + std::to_string(version) +
                  "; this program reads schema " + std::to_string(kSchemaVersion) +
                  ". Index your images again with `pliant index` into a new database, or use the "
                  "Pliant version that made this database");
}

Error NoCollection(const std::string& name) {
  return {ErrorCode::kNotFound, "collection_not_found",
          "No collection has the name \"" + Shown(name) + "\"."};
}

void CheckIsMeant(const AddRequest& request, std::int64_t created_ms) {
  if (request.collection_created_ms == 0 || request.collection_created_ms == created_ms) return;
  throw NoCollection(request.collection);
}

Error NoImage(const std::string& collection, const std::string& id) {
  return {ErrorCode::kNotFound, "image_not_found",
          "No image has the id \"" + Shown(id) + "\" in collection \"" + Shown(collection) + "\"."};
}

Error FeaturesMissing() {
  return {ErrorCode::kCorrupt, "features_missing",
          "the features of a stored image are missing; run `pliant db check`"};
}

}  // namespace pliant::refusals
