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
                  "Pliant that made this one");
}

Error NoCollection(const std::string& name) {
  return {ErrorCode::kNotFound, "collection_not_found",
          "there is no collection \"" + Shown(name) + "\""};
}

void CheckIsMeant(const AddRequest& request, std::int64_t created_ms) {
  if (request.collection_created_ms == 0 || request.collection_created_ms == created_ms) return;
  throw NoCollection(request.collection);
}

Error NoImage(const std::string& collection, const std::string& id) {
  return {ErrorCode::kNotFound, "image_not_found",
          "there is no image \"" + Shown(id) + "\" in collection \"" + Shown(collection) + "\""};
}

Error NoObject(const std::string& object) {
  return {ErrorCode::kNotFound, "object_not_found",
          "there is no image of an object \"" + Shown(object) + "\""};
}

Error ContentNotKept(const std::string& id) {
  return {ErrorCode::kNotFound, "content_not_kept",
          "the uploaded bytes of \"" + Shown(id) + "\" were not kept"};
}

Error FeaturesMissing() {
  return {ErrorCode::kCorrupt, "features_missing",
          "a stored image has lost its features; run `pliant db check`"};
}

Error ObjectExists(const std::string& object, std::uint64_t images) {
  return {ErrorCode::kConflict, "object_exists",
          "there is an object \"" + Shown(object) + "\" already, of " + std::to_string(images) +
              (images == 1 ? " image" : " images") + "; merge=true makes one object of the two"};
}

Error KeyAmbiguous(const std::string& name) {
  return {ErrorCode::kConflict, "key_ambiguous",
          "several keys are called \"" + Shown(name) + "\"; name the id of the one to revoke"};
}

Error NoAlias(const std::string& name) {
  return {ErrorCode::kNotFound, "alias_not_found", "there is no alias \"" + Shown(name) + "\""};
}

Error AliasIsCollection(const std::string& name) {
  return {ErrorCode::kConflict, "collection_exists",
          "\"" + Shown(name) + "\" is a collection and cannot be an alias, too"};
}

Error NoAliasTarget(const std::string& name, const std::string& other) {
  return {ErrorCode::kNotFound, "collection_not_found",
          "there is no collection \"" + Shown(name) + "\"" +
              (other.empty() ? "" : ": that is an alias of \"" + Shown(other) + "\"")};
}

Error CollectionIsAlias(const std::string& alias, const std::string& collection) {
  return {ErrorCode::kConflict, "collection_is_alias",
          "\"" + Shown(alias) + "\" is an alias of the collection \"" + Shown(collection) +
              "\"; remove the alias, or name the collection"};
}

}  // namespace pliant::refusals
