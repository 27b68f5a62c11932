// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/error.h"
#include "descriptor/base/unix_time.h"
#include "index/store/refusals.h"
#include "index/store/sql/rows.h"

namespace pliant {
namespace {

constexpr const char* kSelectCollection =
    "SELECT key, name, model, active_vocabulary, created_ms, automatic, images, objects, "
    "descriptors, display_name FROM collections ";

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
          row.Text(9)};
}

}  // namespace

ModelRow ReadModel(Connection& db) {
  Cursor row = db.Prepare(
      "SELECT key, name, model_id, kind, dim, coalesce(max_keypoints, 0), coalesce(max_side, 0) "
      "FROM models ORDER BY key LIMIT 1");
  row.One();
  return {row.Int(0),
          {{row.Text(1), static_cast<DescriptorKind>(row.Int(3)), static_cast<int>(row.Int(4)),
            row.Text(2)},
           {static_cast<int>(row.Int(5)), static_cast<int>(row.Int(6))}}};
}

void StoreExtraction(Connection& db, Key model, const ExtractionLimits& limits) {
  db.Prepare(
        "UPDATE models SET max_keypoints = coalesce(max_keypoints, nullif(?1, 0)), "
        "max_side = coalesce(max_side, nullif(?2, 0)) WHERE key = ?3")
      .Bind(limits.max_keypoints, limits.max_side_px, model)
      .Run();
}

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

void DeleteCollection(Connection& db, Key collection) {
  db.Prepare("DELETE FROM collections WHERE key = ?").Bind(collection).Run();
}

void SetActiveVocabulary(Connection& db, Key collection, Key vocabulary, bool automatic) {
  db.Prepare("UPDATE collections SET active_vocabulary = ?, automatic = ? WHERE key = ?")
      .Bind(vocabulary, automatic ? 1 : 0, collection)
      .Run();
}

void SetDisplayName(Connection& db, Key collection, const std::string& display_name) {
  db.Prepare("UPDATE collections SET display_name = ? WHERE key = ?")
      .Bind(display_name, collection)
      .Run();
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

void ChangeAliases(Connection& db, const AliasChanges& changes) {
  for (const auto& [name, collection] : changes) {
    if (!collection) {
      if (db.Prepare("DELETE FROM aliases WHERE name = ?").Bind(name).Run() > 0) continue;
      throw refusals::NoAlias(name);
    }
    const auto named = FindCollection(db, name);
    if (named && named->name == name) {
      throw refusals::AliasIsCollection(name);
    }
    const auto target = FindCollection(db, *collection);
    if (!target || target->name != *collection) {  // an alias of an alias would move with it
      throw refusals::NoAliasTarget(*collection, target ? target->name : "");
    }
    db.Prepare(
          "INSERT INTO aliases (name, collection, updated_ms) VALUES (?, ?, ?) ON CONFLICT (name) "
          "DO UPDATE SET collection = excluded.collection, updated_ms = excluded.updated_ms "
          "WHERE aliases.collection <> excluded.collection")
        .Bind(name, target->key, NowMs())
        .Run();
  }
}

Key FindObject(Connection& db, Key collection, const std::string& name) {
  if (name.empty()) return 0;
  Cursor row = db.Prepare("SELECT key FROM objects WHERE collection = ? AND name = ?");
  return row.Bind(collection, name).Next() ? row.Int(0) : 0;
}

Key FindOrInsertObject(Connection& db, Key collection, const std::string& name) {
  if (name.empty()) return 0;
  if (const Key found = FindObject(db, collection, name)) return found;
  return db.Prepare("INSERT INTO objects (collection, name) VALUES (?, ?) RETURNING key")
      .Bind(collection, name)
      .One()
      .Int(0);
}

void RenameObject(Connection& db, Key object, const std::string& name) {
  db.Prepare("UPDATE objects SET name = ? WHERE key = ?").Bind(name, object).Run();
}

std::uint64_t CountImagesOf(Connection& db, Key object) {
  Cursor images = db.Prepare("SELECT count(*) FROM images WHERE object = ?");
  return static_cast<std::uint64_t>(images.Bind(object).One().Int(0));
}

std::uint64_t CountImagesIn(Connection& db, Key collection) {
  Cursor images = db.Prepare("SELECT count(*) FROM images WHERE collection = ?");
  return static_cast<std::uint64_t>(images.Bind(collection).One().Int(0));
}

std::vector<ObjectRecord> SelectObjects(Connection& db, Key collection, const std::string& after,
                                        int limit) {
  Cursor row = db.Prepare(
      "SELECT o.name, (SELECT count(*) FROM images p WHERE p.object = o.key) FROM objects o "
      "WHERE o.collection = ? AND o.name > ? ORDER BY o.name LIMIT ?");
  row.Bind(collection, after, limit);
  std::vector<ObjectRecord> objects;
  while (row.Next()) objects.push_back({row.Text(0), static_cast<std::uint64_t>(row.Int(1))});
  return objects;
}

}  // namespace pliant
