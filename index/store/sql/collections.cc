// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Collections, their aliases and objects: the catalogue and the writer.
#include <algorithm>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/unix_time.h"
#include "index/files/text.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"
#include "index/store/sql/originals.h"
#include "index/store/sql/rows.h"
#include "index/store/writer.h"

namespace pliant {
namespace {

constexpr const char* kSelectCollection =
    "SELECT key, name, model, active_vocabulary, created_ms, automatic, images, objects, "
    "descriptors, display_name, found_from FROM collections ";

CollectionRow ToCollection(const Cursor& row) {
  return {row.Int(0),
          row.Text(1),
          row.Int(2),
          row.IsNull(3) ? 0 : row.Int(3),
          row.Int(4),
          row.Int(5) != 0,
          static_cast<std::uint64_t>(row.Int(6)),
          static_cast<std::uint64_t>(row.Int(7)),
          static_cast<std::uint64_t>(row.Int(8)),
          row.Text(9),
          row.Double(10)};
}

}  // namespace

std::optional<CollectionRow> FindCollection(Connection& db, const std::string& name) {
  Cursor row =
      db.Prepare(std::string(kSelectCollection) +
                 "WHERE name = ?1 OR key = (SELECT collection FROM aliases WHERE name = ?1)");
  if (!row.Bind(name).Next()) return std::nullopt;
  return ToCollection(row);
}

CollectionRow RequireCollection(Connection& db, const std::string& name) {
  if (auto collection = FindCollection(db, name)) return *std::move(collection);
  throw refusals::NoCollection(name);
}

std::vector<CollectionRow> AllCollections(Connection& db) {
  Cursor row = db.Prepare(std::string(kSelectCollection) + "ORDER BY name");
  std::vector<CollectionRow> rows;
  while (row.Next()) rows.push_back(ToCollection(row));
  return rows;
}

Key InsertCollection(Connection& db, const std::string& name, Key model) {
  return db
      .Prepare("INSERT INTO collections (name, model, created_ms) VALUES (?, ?, ?) RETURNING key")
      .Bind(name, model, NowMs())
      .One()
      .Int(0);
}

std::vector<AliasRecord> SelectAliases(Connection& db, Key collection) {
  Cursor row = db.Prepare(
      "SELECT a.name, c.name, a.updated_ms FROM aliases a JOIN collections c "
      "ON c.key = a.collection WHERE ?1 = 0 OR c.key = ?1 ORDER BY a.name");
  row.Bind(collection);
  std::vector<AliasRecord> aliases;
  while (row.Next()) aliases.push_back({row.Text(0), row.Text(1), row.Int(2)});
  return aliases;
}

Key FindObject(Connection& db, Key collection, const std::string& name) {
  if (name.empty()) return 0;
  Cursor row = db.Prepare("SELECT key FROM objects WHERE collection = ? AND name = ?");
  return row.Bind(collection, name).Next() ? row.Int(0) : 0;
}

std::uint64_t CountImagesOf(Connection& db, Key object) {
  Cursor images = db.Prepare("SELECT count(*) FROM images WHERE object = ?");
  return static_cast<std::uint64_t>(images.Bind(object).One().Int(0));
}

std::uint64_t CountImagesIn(Connection& db, Key collection) {
  Cursor images = db.Prepare("SELECT count(*) FROM images WHERE collection = ?");
  return static_cast<std::uint64_t>(images.Bind(collection).One().Int(0));
}

CollectionRecord RecordOf(Connection& db, const CollectionRow& collection) {
  CollectionRecord record;
  record.name = collection.name;
  record.display_name = collection.display_name;
  for (AliasRecord& alias : SelectAliases(db, collection.key)) {
    record.aliases.push_back(std::move(alias.name));
  }
  record.images = collection.images;
  record.objects = collection.objects;
  record.descriptors = collection.descriptors;
  record.created_ms = collection.created_ms;
  record.vocabulary = FindVocabulary(db, collection, collection.active_vocabulary);
  record.automatic = collection.automatic;
  record.found_from = collection.found_from;
  return record;
}

std::vector<std::string> Catalogue::ListCollections() {
  return access_.Read([](Connection& db) {
    std::vector<std::string> names;
    for (CollectionRow& row : AllCollections(db)) names.push_back(std::move(row.name));
    return names;
  });
}

std::vector<CollectionLabel> Catalogue::ListLabels() {
  return access_.Read([](Connection& db) {
    std::vector<CollectionLabel> labels;
    for (CollectionRow& row : AllCollections(db)) {
      labels.push_back({std::move(row.name), std::move(row.display_name), {}});
    }
    for (AliasRecord& alias : SelectAliases(db)) {
      const auto label = std::lower_bound(
          labels.begin(), labels.end(), alias.collection,
          [](const CollectionLabel& one, const std::string& name) { return one.name < name; });
      label->aliases.push_back(std::move(alias.name));
    }
    return labels;
  });
}

std::vector<AliasRecord> Catalogue::ListAliases() {
  return access_.Read([](Connection& db) { return SelectAliases(db); });
}

CollectionState Catalogue::RequireCollection(const std::string& name) {
  return access_.Read([&](Connection& db) { return StateOf(pliant::RequireCollection(db, name)); });
}

CollectionRecord Catalogue::DescribeCollection(const std::string& name) {
  return access_.Read(
      [&](Connection& db) { return RecordOf(db, pliant::RequireCollection(db, name)); });
}

std::string Catalogue::SelfTestOf(const std::string& collection) {
  return access_.Read([&](Connection& db) {
    return db.Prepare("SELECT self_test FROM collections WHERE key = ?")
        .Bind(pliant::RequireCollection(db, collection).key)
        .One()
        .Text(0);
  });
}

std::uint64_t Catalogue::CountImages(Key collection) {
  return access_.Read([&](Connection& db) { return CountImagesIn(db, collection); });
}

std::optional<ObjectRecord> Catalogue::FindObject(const std::string& collection,
                                                  const std::string& object) {
  return access_.Read([&](Connection& db) -> std::optional<ObjectRecord> {
    const Key key = pliant::FindObject(db, pliant::RequireCollection(db, collection).key, object);
    if (key == 0) return std::nullopt;
    return ObjectRecord{object, CountImagesOf(db, key)};
  });
}

bool Writer::CreateCollection(const std::string& name) {
  bool created = false;
  access_.Write([&](Connection& db) {
    created = !FindCollection(db, name).has_value();
    if (created) InsertCollection(db, name, model_.key);
  });
  return created;
}

bool Writer::RemoveCollection(const std::string& name) {
  bool removed = false;
  access_.Write(
      [&](Connection& db) {
        const auto collection = FindCollection(db, name);
        removed = collection.has_value();
        if (!collection) return;
        if (collection->name != name) {
          throw Error(ErrorCode::kConflict, "collection_is_alias",
                      "\"" + Shown(name) + "\" is an alias of the collection \"" +
                          Shown(collection->name) +
                          "\". Delete the alias, or use the collection's own name.");
        }
        db.Prepare("DELETE FROM collections WHERE key = ?").Bind(collection->key).Run();
      },
      {.reclaim = true});
  originals_.Tidy();
  return removed;
}

CollectionRecord Writer::ChangeCollection(const std::string& name, const CollectionChange& change) {
  access_.RequireSpace(0);
  CollectionRecord changed;
  access_.Write([&](Connection& db) {
    const Key key = RequireCollection(db, name).key;
    if (change.display_name) {
      db.Prepare("UPDATE collections SET display_name = ? WHERE key = ?")
          .Bind(*change.display_name, key)
          .Run();
    }
    if (change.found_from) {
      db.Prepare("UPDATE collections SET found_from = ? WHERE key = ?")
          .Bind(*change.found_from, key)
          .Run();
    }
    if (change.self_test) {
      db.Prepare("UPDATE collections SET self_test = ? WHERE key = ?")
          .Bind(*change.self_test, key)
          .Run();
    }
    changed = RecordOf(db, RequireCollection(db, name));
  });
  return changed;
}

void Writer::ChangeAliases(const AliasChanges& changes) {
  access_.RequireSpace(0);
  access_.Write([&](Connection& db) {
    for (const auto& [name, collection] : changes) {
      if (!collection) {
        if (db.Prepare("DELETE FROM aliases WHERE name = ?").Bind(name).Run() > 0) continue;
        throw Error(ErrorCode::kNotFound, "alias_not_found",
                    "No alias has the name \"" + Shown(name) + "\".");
      }
      const auto named = FindCollection(db, name);
      if (named && named->name == name) {
        throw Error(ErrorCode::kConflict, "collection_exists",
                    "\"" + Shown(name) + "\" is a collection. Choose another alias.");
      }
      const auto target = FindCollection(db, *collection);
      if (!target || target->name != *collection) {  // an alias of an alias would move with it
        throw Error(ErrorCode::kNotFound, "collection_not_found",
                    "No collection has the name \"" + Shown(*collection) + "\"." +
                        (target ? " It is an alias of \"" + Shown(target->name) + "\"." : ""));
      }
      db.Prepare(
            "INSERT INTO aliases (name, collection, updated_ms) VALUES (?, ?, ?) ON CONFLICT "
            "(name) "
            "DO UPDATE SET collection = excluded.collection, updated_ms = excluded.updated_ms "
            "WHERE aliases.collection <> excluded.collection")
          .Bind(name, target->key, NowMs())
          .Run();
    }
  });
}

}  // namespace pliant
