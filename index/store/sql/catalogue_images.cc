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

#define PLIANT_IMAGE_COLUMNS                                                              \
  "p.key, p.object, c.name, p.id, o.name, p.sha256, p.media_type, p.metadata, p.source, " \
  "p.width, p.height, p.keypoints, p.bytes, p.added_ms, p.updated_ms"
#define PLIANT_FROM_IMAGES                                     \
  " FROM images p JOIN collections c ON c.key = p.collection " \
  "LEFT JOIN objects o ON o.key = p.object "
#define PLIANT_SELECT_IMAGE "SELECT " PLIANT_IMAGE_COLUMNS PLIANT_FROM_IMAGES

}  // namespace

std::string SelectImageSql() { return PLIANT_SELECT_IMAGE; }

ImageRow ToImage(const Cursor& row) {
  ImageRow image;
  image.key = row.Int(0);
  image.object = row.IsNull(1) ? 0 : row.Int(1);
  ImageRecord& record = image.record;
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
  return image;
}

namespace {

std::optional<ImageRow> FirstImage(Cursor& row) {
  if (!row.Next()) return std::nullopt;
  return ToImage(row);
}

// An unusable hash matches nothing.
std::vector<std::uint8_t> Sha256Bytes(const std::string& hex) {
  return FromHex(hex).value_or(std::vector<std::uint8_t>{});
}

}  // namespace

std::optional<ImageRow> FindImage(Connection& db, Key collection, const std::string& id) {
  Cursor row = db.Prepare(PLIANT_SELECT_IMAGE "WHERE p.collection = ? AND p.id = ?");
  return FirstImage(row.Bind(collection, id));
}

ImageRow RequireImage(Connection& db, const std::string& collection, const std::string& id) {
  auto image = FindImage(db, RequireCollection(db, collection).key, id);
  if (!image) {
    throw refusals::NoImage(collection, id);
  }
  return *std::move(image);
}

Key KeyOfImage(Connection& db, Key collection, const std::string& id) {
  Cursor row = db.Prepare("SELECT key FROM images WHERE collection = ? AND id = ?");
  return row.Bind(collection, id).Next() ? row.Int(0) : 0;
}

std::optional<ImageRow> FindImageByKey(Connection& db, Key key) {
  Cursor row = db.Prepare(PLIANT_SELECT_IMAGE "WHERE p.key = ?");
  return FirstImage(row.Bind(key));
}

// The plus: by the index of hashes, else the whole collection is read, as its index has the order.
std::optional<ImageRow> FindImageBySha256(Connection& db, Key collection,
                                          const std::string& sha256) {
  const std::vector<std::uint8_t> hash = Sha256Bytes(sha256);
  Cursor row = db.Prepare(PLIANT_SELECT_IMAGE
                          "WHERE p.sha256 = ? AND +p.collection = ? ORDER BY p.id LIMIT 1");
  return FirstImage(row.Bind(hash, collection));
}

std::vector<Key> ImagesPassing(Connection& db, Key collection, const Filter& filter) {
  Query query{"SELECT p.key FROM images p WHERE p.collection = "};
  query.sql += query.Bind(collection) + " AND " + db.Passes(query, "p", filter) + " ORDER BY p.key";
  std::vector<Key> passing;
  Cursor row = db.Prepare(query);
  while (row.Next()) passing.push_back(row.Int(0));
  return passing;
}

std::vector<ImageRecord> ImagesBySha256(Connection& db, Key collection, const std::string& sha256) {
  const std::vector<std::uint8_t> hash = Sha256Bytes(sha256);
  Cursor row =
      db.Prepare(PLIANT_SELECT_IMAGE "WHERE p.sha256 = ? AND +p.collection = ? ORDER BY p.id");
  row.Bind(hash, collection);
  std::vector<ImageRecord> records;
  while (row.Next()) records.push_back(ToImage(row).record);
  return records;
}

std::vector<ImageRecord> SelectImages(Connection& db, Key collection, const ListOptions& options) {
  std::vector<ImageRecord> records;
  const auto read = [&](Cursor& row) {
    while (row.Next()) records.push_back(ToImage(row).record);
  };
  if (!options.object) {
    Cursor row =
        db.Prepare(PLIANT_SELECT_IMAGE "WHERE p.collection = ? AND p.id > ? ORDER BY p.id LIMIT ?");
    read(row.Bind(collection, options.after_id, options.limit));
  } else if (options.object->empty()) {
    Cursor row = db.Prepare(
        PLIANT_SELECT_IMAGE
        // +: by the index of objects, else all images are read where each has one.
        "WHERE +p.collection = ? AND p.object IS NULL AND p.id > ? ORDER BY p.id LIMIT ?");
    read(row.Bind(collection, options.after_id, options.limit));
  } else {
    Cursor row =
        db.Prepare(PLIANT_SELECT_IMAGE "WHERE p.object = ? AND p.id > ? ORDER BY p.id LIMIT ?");
    read(row.Bind(FindObject(db, collection, *options.object), options.after_id, options.limit));
  }
  return records;
}

Key FindFeaturesOf(Connection& db, const std::string& sha256, Key model) {
  const std::vector<std::uint8_t> hash = Sha256Bytes(sha256);
  Cursor row = db.Prepare(
      "SELECT p.key FROM images p JOIN features f ON f.image = p.key "
      "WHERE p.sha256 = ? AND f.model = ? ORDER BY p.key LIMIT 1");
  return row.Bind(hash, model).Next() ? row.Int(0) : 0;
}

Key InsertImage(Connection& db, Key collection, const ImageRow& image) {
  const ImageRecord& record = image.record;
  const std::vector<std::uint8_t> hash = Sha256Bytes(record.sha256);
  return db
      .Prepare(
          "INSERT INTO images (collection, id, object, sha256, media_type, width, height, bytes, "
          "keypoints, metadata, source, added_ms, updated_ms) "
          "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) RETURNING key")
      .Bind(collection, record.id, KeyOrNull{image.object}, hash, record.media_type, record.width,
            record.height, record.bytes, record.keypoints, record.metadata, record.source,
            record.added_ms, record.updated_ms)
      .One()
      .Int(0);
}

std::vector<ImageRow> ImagesOf(Connection& db, Key object) {
  Cursor row = db.Prepare(PLIANT_SELECT_IMAGE "WHERE p.object = ? ORDER BY p.id");
  row.Bind(object);
  std::vector<ImageRow> images;
  while (row.Next()) images.push_back(ToImage(row));
  return images;
}

void DescribeImage(Connection& db, Key image, const ImageRecord& record) {
  db.Prepare("UPDATE images SET metadata = ?, source = ?, updated_ms = ? WHERE key = ?")
      .Bind(record.metadata, record.source, record.updated_ms, image)
      .Run();
}

void MoveImage(Connection& db, Key collection, const ImageRow& image, Key object) {
  // Two rows may not have one id; no image's is empty.
  db.Prepare("UPDATE images SET id = '' WHERE key = ?").Bind(image.key).Run();
  ImageRow moved = image;
  moved.object = object;
  const Key key = InsertImage(db, collection, moved);
  for (const char* table : {"features", "originals", "original_files", "image_words"}) {
    db.Prepare(std::string("UPDATE ") + table + " SET image = ? WHERE image = ?")
        .Bind(key, image.key)
        .Run();
  }
  DeleteImage(db, image);
}

void DeleteImage(Connection& db, const ImageRow& image) {
  db.Prepare("DELETE FROM images WHERE key = ?").Bind(image.key).Run();
  if (image.object == 0) return;
  db.Prepare(
        "DELETE FROM objects WHERE key = ?1 AND NOT EXISTS (SELECT 1 FROM images WHERE object = "
        "?1)")
      .Bind(image.object)
      .Run();
}

std::uint64_t DeleteImagesOf(Connection& db, Key object) {
  const auto removed = static_cast<std::uint64_t>(
      db.Prepare("DELETE FROM images WHERE object = ?").Bind(object).Run());
  db.Prepare("DELETE FROM objects WHERE key = ?").Bind(object).Run();
  return removed;
}

void InsertFeatures(Connection& db, Key image, Key model, Bytes blob) {
  db.Prepare("INSERT INTO features (image, model, data) VALUES (?, ?, ?)")
      .Bind(image, model, blob)
      .Run();
}

std::vector<std::uint8_t> ReadFeaturesBlob(Connection& db, Key image) {
  Cursor row = db.Prepare("SELECT data FROM features WHERE image = ?");
  if (!row.Bind(image).Next()) {
    throw refusals::FeaturesMissing();
  }
  return row.CopyOfBlob(0);
}

std::vector<std::vector<std::uint8_t>> ReadFeaturesBlobs(Connection& db,
                                                         std::span<const Key> images) {
  std::map<Key, std::vector<std::uint8_t>> found;
  Cursor row = db.Prepare("SELECT image, data FROM features WHERE " + db.IsAmong("image", "?1"));
  row.Bind(images);
  while (row.Next()) found.emplace(row.Int(0), row.CopyOfBlob(1));
  std::vector<std::vector<std::uint8_t>> blobs;
  for (const Key image : images) {
    const auto blob = found.find(image);
    if (blob == found.end()) throw refusals::FeaturesMissing();
    blobs.push_back(std::move(blob->second));
  }
  return blobs;
}

void SelectStored(Connection& db, const std::multimap<Key, std::size_t>& keys, Load what,
                  const std::function<void(Key, StoredImage)>& take) {
  std::vector<Key> wanted;
  for (const auto& [key, place] : keys) wanted.push_back(key);
  std::map<Key, StoredImage> found;
  {
    Cursor row = db.Prepare(PLIANT_SELECT_IMAGE "WHERE " + db.IsAmong("p.key", "?1"));
    row.Bind(std::span<const Key>(wanted));
    while (row.Next()) {
      ImageRow image = ToImage(row);
      found[image.key] = {image.key, std::move(image.record), {}};
    }
  }
  if (what == Load::kRecordsAndFeatures) {
    FeatureCache* const cache = db.feature_cache();
    wanted.clear();
    for (auto& [key, image] : found) {
      auto cached = cache == nullptr ? std::nullopt : cache->Find(key, db.epoch());
      if (cached) {
        image.features = *std::move(cached);
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
  for (auto& [key, image] : found) take(key, std::move(image));
}

}  // namespace pliant
