// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The catalogue's collections, objects and pictures: one function a statement or two. Private to
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

struct PictureRow {
  Key key = 0;  // the picture's version
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
std::uint64_t CountPicturesOf(Connection& db, Key object);
std::uint64_t CountPicturesIn(Connection& db, Key collection);
std::vector<ObjectRecord> SelectObjects(Connection& db, Key collection, const std::string& after,
                                        int limit);

// pictures (catalogue_pictures.cc)
// SELECT ... FROM pictures p, with its collection c and its object o, and what a row of it is.
std::string SelectPictureSql();
PictureRow ToPicture(const Cursor& row);
PictureRow RequirePicture(Connection& db, const std::string& collection,
                          const std::string& id);  // or kNotFound
std::optional<PictureRow> FindPicture(Connection& db, Key collection, const std::string& id);
Key KeyOfPicture(Connection& db, Key collection, const std::string& id);  // 0 = none
std::optional<PictureRow> FindPictureByKey(Connection& db, Key key);
std::optional<PictureRow> FindPictureBySha256(Connection& db, Key collection,
                                              const std::string& sha256);
// Keys, ascending, of the pictures whose metadata pass. Reads the metadata of the whole collection.
std::vector<Key> PicturesPassing(Connection& db, Key collection, const Filter& filter);
std::vector<ImageRecord> PicturesBySha256(Connection& db, Key collection,
                                          const std::string& sha256);  // in order of id
// `check` of the object as it is.
void CheckObjectNow(Connection& db, Key collection, const ObjectRecord& now,
                    const ObjectCheck& check);
std::vector<ImageRecord> SelectPictures(Connection& db, Key collection, const ListOptions& options);
// A picture of any collection with these bytes whose features were made by `model`; 0 = none.
Key FindFeaturesOf(Connection& db, const std::string& sha256, Key model);
// `picture.record` with `picture.object` as its object; returns the new key.
Key InsertPicture(Connection& db, Key collection, const PictureRow& picture);
std::vector<PictureRow> PicturesOf(Connection& db, Key object);
// Its metadata, its source and when they changed.
void DescribePicture(Connection& db, Key picture, const ImageRecord& record);
// Makes it one of `object` (0 = none), by a new key, so that indexes in memory hear of it, with its
// features, words and original. Also removes an object that has no picture left.
void MovePicture(Connection& db, Key collection, const PictureRow& picture, Key object);
// Also removes an object that has no picture left.
void DeletePicture(Connection& db, const PictureRow& picture);
// How many. Also removes the object.
std::uint64_t DeletePicturesOf(Connection& db, Key object);
void InsertFeatures(Connection& db, Key picture, Key model, Bytes blob);
std::vector<std::uint8_t> ReadFeaturesBlob(Connection& db, Key picture);  // or kCorrupt
// In the order of the keys, none of which comes twice; or kCorrupt.
std::vector<std::vector<std::uint8_t>> ReadFeaturesBlobs(Connection& db,
                                                         std::span<const Key> pictures);
// Gives those of the keys that are there, once each; or kCorrupt where features are asked for and
// missing.
void SelectStored(Connection& db, const std::multimap<Key, std::size_t>& keys, Load what,
                  const std::function<void(Key, StoredPicture)>& take);
// The picture that `request` would only store once more.
std::optional<ImageRecord> FindUnchangedIn(Connection& db, Key collection,
                                           const AddRequest& request, const std::string& sha256);

}  // namespace pliant
