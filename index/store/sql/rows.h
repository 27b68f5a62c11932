// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Rows of collections, objects, images and vocabularies: one or two statements per function.
// Private to index/store/. Functions that write must run inside a transaction (WriteQueue).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

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
  double found_from = kFoundProbability;
};

inline CollectionState StateOf(const CollectionRow& row) {
  return {row.key, row.name, row.active_vocabulary, row.created_ms, row.found_from};
}

struct ImageRow {
  Key key = 0;  // the image's version
  Key object = 0;
  ImageRecord record;
};

// store.cc
ModelRow ReadModel(Connection& db);
// For a new database: its model, and the collection "default".
void InsertFirstRows(Connection& db, const DescriptorInfo& model);

// collections.cc
// By its name or by an alias.
std::optional<CollectionRow> FindCollection(Connection& db, const std::string& name);
CollectionRow RequireCollection(Connection& db, const std::string& name);  // or kNotFound
std::vector<CollectionRow> AllCollections(Connection& db);
Key InsertCollection(Connection& db, const std::string& name, Key model);
// In order of their names; collection 0 = of all.
std::vector<AliasRecord> SelectAliases(Connection& db, Key collection = 0);
CollectionRecord RecordOf(Connection& db, const CollectionRow& collection);
Key FindObject(Connection& db, Key collection, const std::string& name);  // 0 = none
std::uint64_t CountImagesOf(Connection& db, Key object);
std::uint64_t CountImagesIn(Connection& db, Key collection);

// images.cc SELECT ... FROM images p, with its collection c and its object o, and the record of a
// row.
extern const std::string kSelectImage;
ImageRow ToImage(const Cursor& row);
// A SHA-256 in hex digits; no bytes, which match nothing, when it is not hex.
std::vector<std::uint8_t> HashBytes(const std::string& hex);
ImageRow RequireImage(Connection& db, const std::string& collection,
                      const std::string& id);  // or kNotFound
std::optional<ImageRow> FindImage(Connection& db, Key collection, const std::string& id);
Key KeyOfImage(Connection& db, Key collection, const std::string& id);  // 0 = none
std::optional<ImageRow> FindImageByKey(Connection& db, Key key);
// Inserts `image.record` with `image.object` as its object. Returns the new key.
Key InsertImage(Connection& db, Key collection, const ImageRow& image);
// Moves the image to `object` (0 = none) of the collection, with its features, words and original.
// It gets a new key, which this returns, so that indexes in memory notice. Also removes an object
// without images.
Key MoveImage(Connection& db, Key collection, const ImageRow& image, Key object);
// Also removes an object that has no image left.
void DeleteImage(Connection& db, const ImageRow& image);
std::vector<std::uint8_t> ReadFeaturesBlob(Connection& db, Key image);  // or kCorrupt
// In the order of the keys, which must be distinct; or kCorrupt.
std::vector<std::vector<std::uint8_t>> ReadFeaturesBlobs(Connection& db,
                                                         std::span<const Key> images);
// The stored image that `request` would only repeat. Without an id the bytes identify the image.
// Then another object or other metadata is kConflict "same_bytes". Fields that the request omits
// are not compared.
std::optional<ImageRecord> FindUnchangedIn(Connection& db, Key collection,
                                           const AddRequest& request, const std::string& sha256);

// lists.cc
ImagePage SelectImagePage(Connection& db, Key collection, const ImageListing& list);

// vocabularies.cc
// Stores the words as rows; not ready yet. Returns the key.
Key InsertVocabulary(Connection& db, Key collection, Key model, const Vocabulary& vocabulary);
void MarkVocabularyReady(Connection& db, Key vocabulary);
// `automatic`: not on request.
void SetActiveVocabulary(Connection& db, Key collection, Key vocabulary, bool automatic);
// Throws kCorrupt when rows are missing or do not match their checksum.
std::shared_ptr<const Vocabulary> ReadVocabulary(Connection& db, Key vocabulary);
// Ready ones only, oldest first.
std::vector<VocabularyRecord> SelectVocabularies(Connection& db, const CollectionRow& collection);
std::optional<VocabularyRecord> FindVocabulary(Connection& db, const CollectionRow& collection,
                                               Key vocabulary);
// Does nothing if the image was removed.
void InsertImageWords(Connection& db, Key vocabulary, Key image,
                      std::span<const std::uint32_t> words);

}  // namespace pliant
