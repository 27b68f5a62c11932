// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The catalogue's collections, objects and images: one function a statement or two. Private to
// index/store/. Functions that write must run inside a transaction (WriteQueue).
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "index/records/changes.h"
#include "index/records/records.h"
#include "index/store/catalogue.h"
#include "index/store/sql/connection.h"

namespace pliant {

struct ModelRow {
  Key key = 0;
  StoredModel model;
};

struct CollectionRow {
  Key key = 0;
  std::string name;
  Key model = 0;
  Key active_vocabulary = 0;
  std::int64_t created_ms = 0;
  bool automatic = false;  // see CollectionRecord
  std::uint64_t images = 0;
  std::uint64_t objects = 0;
  std::uint64_t descriptors = 0;
  std::string display_name;
};

inline CollectionState StateOf(const CollectionRow& row) {
  return {row.key, row.name, row.active_vocabulary, row.created_ms};
}

struct ImageRow {
  Key key = 0;  // the image's version
  Key object = 0;
  ImageRecord record;
};

// collections and models (catalogue_collections.cc)
ModelRow ReadModel(Connection& db);
// Only what is not decided yet.
void StoreExtraction(Connection& db, Key model, const ExtractionLimits& limits);
// By its name or by an alias.
std::optional<CollectionRow> FindCollection(Connection& db, const std::string& name);
CollectionRow RequireCollection(Connection& db, const std::string& name);  // or kNotFound
std::vector<CollectionRow> AllCollections(Connection& db);
// With all it holds.
void DeleteCollection(Connection& db, Key collection);
Key InsertCollection(Connection& db, const std::string& name, Key model);
// `automatic`: nobody chose it.
void SetActiveVocabulary(Connection& db, Key collection, Key vocabulary, bool automatic);
void SetDisplayName(Connection& db, Key collection, const std::string& display_name);
// In order of their names; collection 0 = of all.
std::vector<AliasRecord> SelectAliases(Connection& db, Key collection = 0);
// Sets and removes aliases. As Writer::ChangeAliases throws.
void ChangeAliases(Connection& db, const AliasChanges& changes);

// objects (catalogue_collections.cc)
Key FindObject(Connection& db, Key collection, const std::string& name);  // 0 = none
Key FindOrInsertObject(Connection& db, Key collection, const std::string& name);
void RenameObject(Connection& db, Key object, const std::string& name);
std::uint64_t CountImagesOf(Connection& db, Key object);
std::uint64_t CountImagesIn(Connection& db, Key collection);
std::vector<ObjectRecord> SelectObjects(Connection& db, Key collection, const std::string& after,
                                        int limit);

// images (catalogue_images.cc)
// SELECT ... FROM images p, with its collection c and its object o, and what a row of it is.
std::string SelectImageSql();
ImageRow ToImage(const Cursor& row);
ImageRow RequireImage(Connection& db, const std::string& collection,
                      const std::string& id);  // or kNotFound
std::optional<ImageRow> FindImage(Connection& db, Key collection, const std::string& id);
Key KeyOfImage(Connection& db, Key collection, const std::string& id);  // 0 = none
std::optional<ImageRow> FindImageByKey(Connection& db, Key key);
std::optional<ImageRow> FindImageBySha256(Connection& db, Key collection,
                                          const std::string& sha256);
// Keys, ascending, of the images whose metadata pass. Reads the metadata of the whole collection.
std::vector<Key> ImagesPassing(Connection& db, Key collection, const Filter& filter);
std::vector<ImageRecord> ImagesBySha256(Connection& db, Key collection,
                                        const std::string& sha256);  // in order of id
// `check` of the object as it is.
void CheckObjectNow(Connection& db, Key collection, const ObjectRecord& now,
                    const ObjectCheck& check);
std::vector<ImageRecord> SelectImages(Connection& db, Key collection, const ListOptions& options);
// An image of any collection with these bytes whose features were made by `model`; 0 = none.
Key FindFeaturesOf(Connection& db, const std::string& sha256, Key model);
// `image.record` with `image.object` as its object; returns the new key.
Key InsertImage(Connection& db, Key collection, const ImageRow& image);
std::vector<ImageRow> ImagesOf(Connection& db, Key object);
// Its metadata, its source and when they changed.
void DescribeImage(Connection& db, Key image, const ImageRecord& record);
// Makes it one of `object` (0 = none), by a new key, so that indexes in memory hear of it, with its
// features, words and original. Also removes an object that has no image left.
void MoveImage(Connection& db, Key collection, const ImageRow& image, Key object);
// Also removes an object that has no image left.
void DeleteImage(Connection& db, const ImageRow& image);
// How many. Also removes the object.
std::uint64_t DeleteImagesOf(Connection& db, Key object);
void InsertFeatures(Connection& db, Key image, Key model, Bytes blob);
std::vector<std::uint8_t> ReadFeaturesBlob(Connection& db, Key image);  // or kCorrupt
// In the order of the keys, none of which comes twice; or kCorrupt.
std::vector<std::vector<std::uint8_t>> ReadFeaturesBlobs(Connection& db,
                                                         std::span<const Key> images);
// Gives those of the keys that are there, once each; or kCorrupt where features are asked for and
// missing.
void SelectStored(Connection& db, const std::multimap<Key, std::size_t>& keys, Load what,
                  const std::function<void(Key, StoredImage)>& take);
// The image that `request` would only store once more.
std::optional<ImageRecord> FindUnchangedIn(Connection& db, Key collection,
                                           const AddRequest& request, const std::string& sha256);

}  // namespace pliant
