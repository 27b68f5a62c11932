// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: what one collection or one object holds.
#include "index/engine/engine_impl.h"
#include "index/store/sqlite/catalogue_vocabularies.h"
#include "index/store/sqlite/database.h"

namespace pliant {

CollectionRecord Engine::GetCollection(const std::string& name) {
  return impl_->Read([&](Connection& db) {
    const CollectionRow row = RequireCollection(db, name);
    CollectionRecord record;
    record.name = row.name;
    record.created_ms = row.created_ms;
    record.images = row.images;
    record.objects = row.objects;
    record.descriptors = row.descriptors;
    record.vocabulary = FindVocabulary(db, row, row.active_vocabulary);
    record.automatic = row.automatic;
    return record;
  });
}

std::optional<ObjectRecord> Engine::GetObject(const std::string& collection,
                                              const std::string& object) {
  return impl_->Read([&](Connection& db) -> std::optional<ObjectRecord> {
    const Key key = FindObject(db, RequireCollection(db, collection).key, object);
    if (key == 0) return std::nullopt;
    Cursor images = db.Prepare("SELECT count(*) FROM pictures WHERE object = ?");
    return ObjectRecord{object, static_cast<std::uint64_t>(images.Bind(key).One().Int(0))};
  });
}

}  // namespace pliant
