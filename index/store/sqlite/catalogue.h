// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The catalogue's collections, objects and pictures: one function a statement or two. Private to
// index/. Functions that write must run inside a transaction (WriteQueue).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "index/engine/engine.h"
#include "index/store/sqlite/connection.h"

namespace pliant {

using Key = std::int64_t;  // of a row; 0 = none

struct ModelRow {
  Key key = 0;
  DescriptorInfo info;
  int max_keypoints = 0;  // 0 = not decided
  int max_side_px = 0;    // 0 = not decided
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
};

struct PictureRow {
  Key key = 0;
  Key object = 0;
  ImageRecord record;
};

// collections and models (catalogue_collections.cc)
ModelRow ReadModel(Connection& db);
// Only what is not decided yet.
void StoreExtraction(Connection& db, Key model, int max_keypoints, int max_side_px);
std::optional<CollectionRow> FindCollection(Connection& db, const std::string& name);
CollectionRow RequireCollection(Connection& db, const std::string& name);  // or kNotFound
std::vector<CollectionRow> AllCollections(Connection& db);
Key InsertCollection(Connection& db, const std::string& name, Key model);
// `automatic`: nobody chose it.
void SetActiveVocabulary(Connection& db, Key collection, Key vocabulary, bool automatic);

// objects (catalogue_collections.cc)
Key FindObject(Connection& db, Key collection, const std::string& name);  // 0 = none
Key FindOrInsertObject(Connection& db, Key collection, const std::string& name);
std::vector<ObjectRecord> SelectObjects(Connection& db, Key collection, const std::string& after,
                                        int limit);

// pictures (catalogue_pictures.cc)
std::optional<PictureRow> FindPicture(Connection& db, Key collection, const std::string& id);
std::optional<PictureRow> FindPictureByKey(Connection& db, Key key);
std::optional<PictureRow> FindPictureBySha256(Connection& db, Key collection,
                                              const std::string& sha256);
// Keys, ascending, of the pictures whose metadata pass. Reads the metadata of the whole collection.
std::vector<Key> PicturesPassing(Connection& db, Key collection, const Filter& filter);
std::vector<ImageRecord> PicturesBySha256(Connection& db, Key collection,
                                          const std::string& sha256);  // in order of id
std::vector<ImageRecord> SelectPictures(Connection& db, Key collection, const ListOptions& options);
// A picture of any collection with these bytes whose features were made by `model`; 0 = none.
Key FindFeaturesOf(Connection& db, const std::string& sha256, Key model);
// `picture.record` with `picture.object` as its object; returns the new key.
Key InsertPicture(Connection& db, Key collection, const PictureRow& picture);
// Also removes an object that has no picture left.
void DeletePicture(Connection& db, const PictureRow& picture);
void InsertFeatures(Connection& db, Key picture, Key model, Bytes blob);
std::vector<std::uint8_t> ReadFeaturesBlob(Connection& db, Key picture);  // or kCorrupt

}  // namespace pliant
