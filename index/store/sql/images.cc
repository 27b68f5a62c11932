// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images: the catalogue, and rows for the writer.
#include <algorithm>
#include <map>
#include <memory>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "index/files/text.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"
#include "index/store/sql/originals.h"
#include "index/store/sql/rows.h"

namespace pliant {

const std::string kSelectImage =
    "SELECT p.key, p.object, c.name, p.id, o.name, p.sha256, p.media_type, p.metadata, p.source, "
    "p.width, p.height, p.keypoints, p.bytes, p.added_ms, p.updated_ms FROM images p "
    "JOIN collections c ON c.key = p.collection LEFT JOIN objects o ON o.key = p.object ";

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

std::vector<std::uint8_t> HashBytes(const std::string& hex) {
  return FromHex(hex).value_or(std::vector<std::uint8_t>{});
}

namespace {

std::optional<ImageRow> FirstImage(Cursor& row) {
  if (!row.Next()) return std::nullopt;
  return ToImage(row);
}

}  // namespace

std::optional<ImageRow> FindImage(Connection& db, Key collection, const std::string& id) {
  Cursor row = db.Prepare(kSelectImage + "WHERE p.collection = ? AND p.id = ?");
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
  Cursor row = db.Prepare(kSelectImage + "WHERE p.key = ?");
  return FirstImage(row.Bind(key));
}

Key InsertImage(Connection& db, Key collection, const ImageRow& image) {
  const ImageRecord& record = image.record;
  const std::vector<std::uint8_t> hash = HashBytes(record.sha256);
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

Key MoveImage(Connection& db, Key collection, const ImageRow& image, Key object) {
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
  return key;
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

namespace {

bool OtherObject(const ImageRecord& stored, const AddRequest& request) {
  return !request.object.empty() && request.object != stored.object;
}

bool OtherMetadata(const ImageRecord& stored, const AddRequest& request) {
  return request.metadata != "{}" && request.metadata != stored.metadata;
}

[[noreturn]] void ThrowSameBytes(const ImageRecord& stored, const AddRequest& request) {
  const bool other_object = OtherObject(stored, request);
  const std::string difference = other_object
                                     ? "of object \"" + ToDisplayText(stored.object) +
                                           "\", not \"" + ToDisplayText(request.object) + "\""
                                     : "with other metadata";
  throw Error(ErrorCode::kConflict, "same_bytes",
              "The same bytes are stored as image \"" + ToDisplayText(stored.id) + "\" " +
                  difference + ". Change that image, or store a copy with another id.");
}

std::optional<ImageRecord> FindMeant(const std::vector<ImageRecord>& same_bytes,
                                     const AddRequest& request) {
  for (const ImageRecord& stored : same_bytes) {
    if (!OtherObject(stored, request) && !OtherMetadata(stored, request)) return stored;
  }
  if (!same_bytes.empty()) ThrowSameBytes(same_bytes.front(), request);
  return std::nullopt;
}

std::vector<ImageRecord> ImagesBySha256(Connection& db, Key collection, const std::string& sha256) {
  const std::vector<std::uint8_t> hash = HashBytes(sha256);
  Cursor row = db.Prepare(kSelectImage + "WHERE p.sha256 = ? AND +p.collection = ? ORDER BY p.id");
  row.Bind(hash, collection);
  std::vector<ImageRecord> records;
  while (row.Next()) records.push_back(ToImage(row).record);
  return records;
}

std::vector<Key> ImagesPassing(Connection& db, Key collection, const Filter& filter) {
  Query query{"SELECT p.key FROM images p WHERE p.collection = "};
  query.sql += query.Bind(collection) + " AND " + db.Passes(query, "p", filter) + " ORDER BY p.key";
  std::vector<Key> passing;
  Cursor row = db.Prepare(query);
  while (row.Next()) passing.push_back(row.Int(0));
  return passing;
}

void SelectStored(Connection& db, const std::multimap<Key, std::size_t>& keys, Load what,
                  const std::function<void(Key, StoredImage)>& take) {
  std::vector<Key> wanted;
  for (const auto& [key, place] : keys) wanted.push_back(key);
  std::map<Key, StoredImage> found;
  {
    Cursor row = db.Prepare(kSelectImage + "WHERE " + db.IsAmong("p.key", "?1"));
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
      const auto cached = cache == nullptr ? nullptr : cache->Find({db.epoch(), key});
      if (cached) {
        image.features = *cached;
      } else {
        wanted.push_back(key);
      }
    }
    std::vector<std::vector<std::uint8_t>> read = ReadFeaturesBlobs(db, wanted);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      if (cache != nullptr) {
        cache->Add({db.epoch(), wanted[i]},
                   std::make_shared<const std::vector<std::uint8_t>>(read[i]));
      }
      found[wanted[i]].features = std::move(read[i]);
    }
  }
  for (auto& [key, image] : found) take(key, std::move(image));
}

}  // namespace

std::optional<ImageRecord> Catalogue::FindImage(const std::string& collection,
                                                const std::string& id) {
  return access_.Read([&](Connection& db) -> std::optional<ImageRecord> {
    auto found = pliant::FindImage(db, pliant::RequireCollection(db, collection).key, id);
    if (!found) return std::nullopt;
    return std::move(found->record);
  });
}

std::optional<ImageRecord> Catalogue::FindBySha256(const std::string& collection,
                                                   const std::string& sha256) {
  return access_.Read([&](Connection& db) -> std::optional<ImageRecord> {
    auto same = ImagesBySha256(db, pliant::RequireCollection(db, collection).key, sha256);
    if (same.empty()) return std::nullopt;
    return std::move(same.front());
  });
}

std::optional<ImageRecord> FindUnchangedIn(Connection& db, Key collection,
                                           const AddRequest& request, const std::string& sha256) {
  if (!request.id) return FindMeant(ImagesBySha256(db, collection, sha256), request);
  auto found = FindImage(db, collection, *request.id);
  const bool unchanged = found && found->record.sha256 == sha256 &&
                         found->record.object == request.object &&
                         found->record.metadata == request.metadata;
  if (!unchanged) return std::nullopt;
  return std::move(found->record);
}

std::optional<ImageRecord> Catalogue::FindUnchanged(const AddRequest& request,
                                                    const std::string& sha256) {
  return access_.Read([&](Connection& db) {
    const CollectionRow in = pliant::RequireCollection(db, request.collection);
    refusals::CheckIsMeant(request, in.created_ms);
    return FindUnchangedIn(db, in.key, request, sha256);
  });
}

std::optional<StoredImage> Catalogue::FindDescribed(const std::string& sha256) {
  return access_.Read([&](Connection& db) -> std::optional<StoredImage> {
    const std::vector<std::uint8_t> hash = HashBytes(sha256);
    Cursor row = db.Prepare(
        "SELECT p.key, f.data FROM images p JOIN features f ON f.image = p.key "
        "WHERE p.sha256 = ? AND f.model = ? ORDER BY p.key LIMIT 1");
    if (!row.Bind(hash, model_.key).Next()) return std::nullopt;
    const Key key = row.Int(0);
    return StoredImage{key, FindImageByKey(db, key)->record, row.CopyOfBlob(1)};
  });
}

std::vector<std::optional<StoredImage>> Catalogue::LoadImages(std::span<const ImageRef> refs,
                                                              Load what) {
  return access_.Read([&](Connection& db) {
    std::vector<std::optional<StoredImage>> images(refs.size());
    std::multimap<Key, std::size_t> wanted;  // positions in `images`
    const auto fill = [&](Key key, StoredImage image) {
      const auto [begin, end] = wanted.equal_range(key);
      for (auto at = std::next(begin); at != end; ++at) images[at->second] = image;
      images[begin->second] = std::move(image);
    };
    for (std::size_t i = 0; i < refs.size(); ++i) wanted.emplace(refs[i].version, i);
    SelectStored(db, wanted, what, fill);
    wanted.clear();
    for (std::size_t i = 0; i < refs.size(); ++i) {
      if (images[i]) continue;
      const Key other = KeyOfImage(db, refs[i].collection, refs[i].id);  // in its place
      if (other != 0) wanted.emplace(other, i);
    }
    if (!wanted.empty()) SelectStored(db, wanted, what, fill);
    return images;
  });
}

std::vector<std::uint8_t> Catalogue::ReadContent(const std::string& collection,
                                                 const std::string& id) {
  return originals_.Read(collection, id);
}

Admission Catalogue::Admit(Key collection, const std::optional<std::string>& object,
                           const Filter& filter, const std::vector<std::string>& without) {
  Admission admission;
  admission.object = object;
  admission.filter = filter;
  admission.without = without;
  if (!object && filter.empty() && without.empty()) return admission;
  access_.Read([&](Connection& db) {
    if (object) {
      admission.object_key = pliant::FindObject(db, collection, *object);
      admission.nothing = *admission.object_key == 0 && !object->empty();
    }
    for (const std::string& id : without) {
      if (const Key key = KeyOfImage(db, collection, id)) {
        admission.without_versions.push_back(key);
      }
    }
    std::sort(admission.without_versions.begin(), admission.without_versions.end());
    if (filter.empty() || admission.nothing) return;
    admission.versions =
        std::make_shared<const std::vector<std::int64_t>>(ImagesPassing(db, collection, filter));
  });
  return admission;
}

}  // namespace pliant
