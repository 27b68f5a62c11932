// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Changes the stored records. Each call is durable when it returns, or has no effect. The ranker
// has received the change then (Store::BeginWriting). Thread-safe. Throws what a database throws:
// kUnavailable, kNoSpace, kReadOnly, kCorrupt; kNotFound "collection_not_found".
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "index/records/image_ref.h"
#include "index/records/listing.h"
#include "index/records/records.h"
#include "vocab/quantizer.h"

namespace pliant {

// An image with all its data, computed before the writer's turn.
struct ImagePut {
  const AddRequest& request;  // outlives the put
  ImageRecord record = {};
  std::vector<std::uint8_t> encoded = {};  // features (blob_codec.h)
  Features features = {};                  // the same, in stored precision
  Key vocabulary = 0;                      // of `words`; if another is active, quantise again
  std::vector<std::uint32_t> words = {};   // of the descriptors
  bool keep_content = true;                // also store the uploaded bytes
  ImageCheck check = {};                   // receives the image that has the id
  bool keep_times = false;                 // the record's times: a copy of another database's image
};

struct PutOutcome {
  AddOutcome outcome = AddOutcome::kCreated;
  ImageRecord image;
};

class Access;
class Connection;
class IncomingOriginal;
class OriginalsKeeper;
struct ModelRow;

class Writer {
 public:
  // All must outlive it.
  Writer(Access* access, OriginalsKeeper* originals, const ModelRow* model)
      : access_(*access), originals_(*originals), model_(*model) {}

  // Checks again whether the same is stored already: kUnchanged. Throws what `put.check` throws.
  PutOutcome Put(const ImagePut& put) { return PutAll({&put, 1}).front(); }
  // In one commit, in this order: all, or none if one of them throws. Returns an outcome for each.
  std::vector<PutOutcome> PutAll(std::span<const ImagePut> puts);
  // Restores the bytes of a stored image whose file is missing.
  void RestoreContent(const ImageRecord& stored, Bytes bytes);
  // Returns the new image or object. Features, words and bytes stay. kNotFound "image_not_found",
  // "object_not_found"; kInvalidArgument "metadata_invalid"; kConflict "object_exists",
  // "image_exists" (in the collection to move to); what `check` throws.
  ImageRecord ChangeImage(const std::string& collection, const std::string& id,
                          const ImageChange& change);
  ObjectRecord ChangeObject(const std::string& collection, const std::string& object,
                            const ObjectChange& change);
  // `check` receives the present record; it can be empty.
  bool Remove(const std::string& collection, const std::string& id, const ImageCheck& check);
  std::uint64_t RemoveObject(const std::string& collection, const std::string& object,
                             const ObjectCheck& check);

  std::uint64_t RemoveWhere(const Selection& which);  // their number; in one step

  bool CreateCollection(const std::string& name);  // false = it existed already
  // With its aliases. false = it did not exist. kConflict "collection_is_alias" for an alias.
  bool RemoveCollection(const std::string& name);
  CollectionRecord ChangeCollection(const std::string& name, const CollectionChange& change);
  // All in one step, or none. kNotFound "alias_not_found" for an alias to remove,
  // "collection_not_found"; kConflict "collection_exists" for an alias with the name of a
  // collection.
  void ChangeAliases(const AliasChanges& changes);

  // A vocabulary is made in three steps: add it (not ready yet); give words to images; finish it.
  // FinishVocabulary and SetActiveVocabulary also give words to the remaining images, while no
  // image can be added.
  Key AddVocabulary(Key collection, const Vocabulary& vocabulary);
  // Gives words of the vocabulary to the images of the collection that lack them, in batches, while
  // others add images. `progress` receives their number before each batch and at the end; its
  // exceptions end the work. `threads`: 0 = all cores.
  void Quantize(Key collection, Key vocabulary, const Quantizer& quantizer, int threads,
                const std::function<void(std::uint64_t images)>& progress);
  // Makes it ready, and active if the collection has no active one. `automatic`: not on request
  // (CollectionRecord).
  VocabularyRecord FinishVocabulary(const std::string& collection, Key vocabulary,
                                    const Quantizer& quantizer, bool automatic);
  // An automatic one does not replace one that a person has chosen.
  void SetActiveVocabulary(const std::string& collection, Key vocabulary,
                           const Quantizer& quantizer, bool automatic);
  void DropVocabulary(Key vocabulary);

  // Originals in files: see Engine.
  std::uint64_t SweepOriginals();
  MoveOriginalsResult MoveOriginals(const std::filesystem::path& directory,
                                    const std::function<void(double)>& progress);

 private:
  PutOutcome Store(Connection& db, const ImagePut& put, IncomingOriginal* original) const;

  Access& access_;
  OriginalsKeeper& originals_;
  const ModelRow& model_;
};

}  // namespace pliant
