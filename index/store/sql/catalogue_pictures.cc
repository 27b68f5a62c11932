// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "index/files/text.h"
#include "index/store/refusals.h"
#include "index/store/sql/feature_cache.h"
#include "index/store/sql/rows.h"

namespace pliant {
namespace {

#define PLIANT_PICTURE_COLUMNS                                                            \
  "p.key, p.object, c.name, p.id, o.name, p.sha256, p.media_type, p.metadata, p.source, " \
  "p.width, p.height, p.keypoints, p.bytes, p.added_ms, p.updated_ms"
#define PLIANT_FROM_PICTURES                                     \
  " FROM pictures p JOIN collections c ON c.key = p.collection " \
  "LEFT JOIN objects o ON o.key = p.object "
#define PLIANT_SELECT_PICTURE "SELECT " PLIANT_PICTURE_COLUMNS PLIANT_FROM_PICTURES

}  // namespace

std::string SelectPictureSql() { return PLIANT_SELECT_PICTURE; }

PictureRow ToPicture(const Cursor& row) {
  PictureRow picture;
  picture.key = row.Int(0);
  picture.object = row.IsNull(1) ? 0 : row.Int(1);
  ImageRecord& record = picture.record;
  record.collection = row.Text(2);
  record.id = row.Text(3);
  if (!row.IsNull(4)) record.object = row.Text(4);
  record.sha256 = ToHex(row.Blob(5));
  record.media_type = row.Text(6);
  record.metadata = row.Text(7);
  record.source = row.Text(8);
  record.width = static_cast<int>(row.Int(9));
  record.height = static_cast<int>(row.Int(10));
  record.keypoints = static_cast<std::uint32_t>(row.Int(11));
  record.bytes = static_cast<std::uint64_t>(row.Int(12));
  record.added_ms = row.Int(13);
  record.updated_ms = row.Int(14);
  return picture;
}

namespace {

std::optional<PictureRow> FirstPicture(Cursor& row) {
  if (!row.Next()) return std::nullopt;
  return ToPicture(row);
}

// An unusable hash matches nothing.
std::vector<std::uint8_t> Sha256Bytes(const std::string& hex) {
  return FromHex(hex).value_or(std::vector<std::uint8_t>{});
}

}  // namespace

std::optional<PictureRow> FindPicture(Connection& db, Key collection, const std::string& id) {
  Cursor row = db.Prepare(PLIANT_SELECT_PICTURE "WHERE p.collection = ? AND p.id = ?");
  return FirstPicture(row.Bind(collection, id));
}

PictureRow RequirePicture(Connection& db, const std::string& collection, const std::string& id) {
  auto picture = FindPicture(db, RequireCollection(db, collection).key, id);
  if (!picture) {
    throw refusals::NoPicture(collection, id);
  }
  return *std::move(picture);
}

Key KeyOfPicture(Connection& db, Key collection, const std::string& id) {
  Cursor row = db.Prepare("SELECT key FROM pictures WHERE collection = ? AND id = ?");
  return row.Bind(collection, id).Next() ? row.Int(0) : 0;
}

std::optional<PictureRow> FindPictureByKey(Connection& db, Key key) {
  Cursor row = db.Prepare(PLIANT_SELECT_PICTURE "WHERE p.key = ?");
  return FirstPicture(row.Bind(key));
}

// The plus: by the index of hashes, else the whole collection is read, as its index has the order.
std::optional<PictureRow> FindPictureBySha256(Connection& db, Key collection,
                                              const std::string& sha256) {
  const std::vector<std::uint8_t> hash = Sha256Bytes(sha256);
  Cursor row = db.Prepare(PLIANT_SELECT_PICTURE
                          "WHERE p.sha256 = ? AND +p.collection = ? ORDER BY p.id LIMIT 1");
  return FirstPicture(row.Bind(hash, collection));
}

std::vector<Key> PicturesPassing(Connection& db, Key collection, const Filter& filter) {
  Query query{"SELECT p.key FROM pictures p WHERE p.collection = "};
  query.sql += query.Bind(collection) + " AND " + db.Passes(query, "p", filter) + " ORDER BY p.key";
  std::vector<Key> passing;
  Cursor row = db.Prepare(query);
  while (row.Next()) passing.push_back(row.Int(0));
  return passing;
}

std::vector<ImageRecord> PicturesBySha256(Connection& db, Key collection,
                                          const std::string& sha256) {
  const std::vector<std::uint8_t> hash = Sha256Bytes(sha256);
  Cursor row =
      db.Prepare(PLIANT_SELECT_PICTURE "WHERE p.sha256 = ? AND +p.collection = ? ORDER BY p.id");
  row.Bind(hash, collection);
  std::vector<ImageRecord> records;
  while (row.Next()) records.push_back(ToPicture(row).record);
  return records;
}

std::vector<ImageRecord> SelectPictures(Connection& db, Key collection,
                                        const ListOptions& options) {
  std::vector<ImageRecord> records;
  const auto read = [&](Cursor& row) {
    while (row.Next()) records.push_back(ToPicture(row).record);
  };
  if (!options.object) {
    Cursor row = db.Prepare(PLIANT_SELECT_PICTURE
                            "WHERE p.collection = ? AND p.id > ? ORDER BY p.id LIMIT ?");
    read(row.Bind(collection, options.after_id, options.limit));
  } else if (options.object->empty()) {
    Cursor row = db.Prepare(
        PLIANT_SELECT_PICTURE
        // +: by the index of objects, else all pictures are read where each has one.
        "WHERE +p.collection = ? AND p.object IS NULL AND p.id > ? ORDER BY p.id LIMIT ?");
    read(row.Bind(collection, options.after_id, options.limit));
  } else {
    Cursor row =
        db.Prepare(PLIANT_SELECT_PICTURE "WHERE p.object = ? AND p.id > ? ORDER BY p.id LIMIT ?");
    read(row.Bind(FindObject(db, collection, *options.object), options.after_id, options.limit));
  }
  return records;
}

Key FindFeaturesOf(Connection& db, const std::string& sha256, Key model) {
  const std::vector<std::uint8_t> hash = Sha256Bytes(sha256);
  Cursor row = db.Prepare(
      "SELECT p.key FROM pictures p JOIN features f ON f.picture = p.key "
      "WHERE p.sha256 = ? AND f.model = ? ORDER BY p.key LIMIT 1");
  return row.Bind(hash, model).Next() ? row.Int(0) : 0;
}

Key InsertPicture(Connection& db, Key collection, const PictureRow& picture) {
  const ImageRecord& record = picture.record;
  const std::vector<std::uint8_t> hash = Sha256Bytes(record.sha256);
  return db
      .Prepare(
          "INSERT INTO pictures (collection, id, object, sha256, media_type, width, height, bytes, "
          "keypoints, metadata, source, added_ms, updated_ms) "
          "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) RETURNING key")
      .Bind(collection, record.id, KeyOrNull{picture.object}, hash, record.media_type, record.width,
            record.height, record.bytes, record.keypoints, record.metadata, record.source,
            record.added_ms, record.updated_ms)
      .One()
      .Int(0);
}

std::vector<PictureRow> PicturesOf(Connection& db, Key object) {
  Cursor row = db.Prepare(PLIANT_SELECT_PICTURE "WHERE p.object = ? ORDER BY p.id");
  row.Bind(object);
  std::vector<PictureRow> pictures;
  while (row.Next()) pictures.push_back(ToPicture(row));
  return pictures;
}

void DescribePicture(Connection& db, Key picture, const ImageRecord& record) {
  db.Prepare("UPDATE pictures SET metadata = ?, source = ?, updated_ms = ? WHERE key = ?")
      .Bind(record.metadata, record.source, record.updated_ms, picture)
      .Run();
}

void MovePicture(Connection& db, Key collection, const PictureRow& picture, Key object) {
  // Two rows may not have one id; no picture's is empty.
  db.Prepare("UPDATE pictures SET id = '' WHERE key = ?").Bind(picture.key).Run();
  PictureRow moved = picture;
  moved.object = object;
  const Key key = InsertPicture(db, collection, moved);
  for (const char* table : {"features", "originals", "original_files", "picture_words"}) {
    db.Prepare(std::string("UPDATE ") + table + " SET picture = ? WHERE picture = ?")
        .Bind(key, picture.key)
        .Run();
  }
  DeletePicture(db, picture);
}

void DeletePicture(Connection& db, const PictureRow& picture) {
  db.Prepare("DELETE FROM pictures WHERE key = ?").Bind(picture.key).Run();
  if (picture.object == 0) return;
  db.Prepare(
        "DELETE FROM objects WHERE key = ?1 AND NOT EXISTS (SELECT 1 FROM pictures WHERE object = "
        "?1)")
      .Bind(picture.object)
      .Run();
}

std::uint64_t DeletePicturesOf(Connection& db, Key object) {
  const auto removed = static_cast<std::uint64_t>(
      db.Prepare("DELETE FROM pictures WHERE object = ?").Bind(object).Run());
  db.Prepare("DELETE FROM objects WHERE key = ?").Bind(object).Run();
  return removed;
}

void InsertFeatures(Connection& db, Key picture, Key model, Bytes blob) {
  db.Prepare("INSERT INTO features (picture, model, data) VALUES (?, ?, ?)")
      .Bind(picture, model, blob)
      .Run();
}

std::vector<std::uint8_t> ReadFeaturesBlob(Connection& db, Key picture) {
  Cursor row = db.Prepare("SELECT data FROM features WHERE picture = ?");
  if (!row.Bind(picture).Next()) {
    throw refusals::FeaturesMissing();
  }
  return row.CopyOfBlob(0);
}

std::vector<std::vector<std::uint8_t>> ReadFeaturesBlobs(Connection& db,
                                                         std::span<const Key> pictures) {
  std::map<Key, std::vector<std::uint8_t>> found;
  Cursor row =
      db.Prepare("SELECT picture, data FROM features WHERE " + db.IsAmong("picture", "?1"));
  row.Bind(pictures);
  while (row.Next()) found.emplace(row.Int(0), row.CopyOfBlob(1));
  std::vector<std::vector<std::uint8_t>> blobs;
  for (const Key picture : pictures) {
    const auto blob = found.find(picture);
    if (blob == found.end()) throw refusals::FeaturesMissing();
    blobs.push_back(std::move(blob->second));
  }
  return blobs;
}

void SelectStored(Connection& db, const std::multimap<Key, std::size_t>& keys, Load what,
                  const std::function<void(Key, StoredPicture)>& take) {
  std::vector<Key> wanted;
  for (const auto& [key, place] : keys) wanted.push_back(key);
  std::map<Key, StoredPicture> found;
  {
    Cursor row = db.Prepare(PLIANT_SELECT_PICTURE "WHERE " + db.IsAmong("p.key", "?1"));
    row.Bind(std::span<const Key>(wanted));
    while (row.Next()) {
      PictureRow picture = ToPicture(row);
      found[picture.key] = {picture.key, std::move(picture.record), {}};
    }
  }
  if (what == Load::kRecordsAndFeatures) {
    FeatureCache* const cache = db.feature_cache();
    wanted.clear();
    for (auto& [key, picture] : found) {
      auto cached = cache == nullptr ? std::nullopt : cache->Find(key, db.epoch());
      if (cached) {
        picture.features = *std::move(cached);
      } else {
        wanted.push_back(key);
      }
    }
    std::vector<std::vector<std::uint8_t>> read = ReadFeaturesBlobs(db, wanted);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      if (cache != nullptr) cache->Add(wanted[i], read[i], db.epoch());
      found[wanted[i]].features = std::move(read[i]);
    }
  }
  for (auto& [key, picture] : found) take(key, std::move(picture));
}

}  // namespace pliant
