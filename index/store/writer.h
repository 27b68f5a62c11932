// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is kept, changed. Each call is durable when it returns, whole or not at all, and the ranker
// has heard of it (Store::BeginWriting). Thread-safe. Throws what a database throws: kUnavailable,
// kNoSpace, kReadOnly, kCorrupt; kNotFound "collection_not_found".
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

// An image with everything about it that takes time, worked out before the writer's turn.
struct ImagePut {
  const AddRequest& request;  // outlives the put
  ImageRecord record = {};
  std::vector<std::uint8_t> encoded = {};  // features (blob_codec.h)
  Features features = {};                  // the same, in stored precision
  Key vocabulary = 0;  // that made `bow`; another is active by now: quantised anew
  Bow bow = {};
  bool keep_content = true;  // the uploaded bytes too
  ImageCheck check = {};     // of the image that has the id
  bool keep_times = false;   // those of the record: a copy of another database's image
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

  // Looks once more whether the same is stored already: kUnchanged. What `put.check` throws.
  PutOutcome Put(const ImagePut& put) { return PutAll({&put, 1}).front(); }
  // In one commit, in this order: all, or none where one of them throws. An outcome for each.
  std::vector<PutOutcome> PutAll(std::span<const ImagePut> puts);
  // The bytes of a stored image, where its file has been lost.
  void RestoreContent(const ImageRecord& stored, Bytes bytes);
  // The image, or the object, as it is then. Features, words and bytes stay. kNotFound
  // "image_not_found", "object_not_found"; kInvalidArgument "metadata_invalid"; kConflict
  // "object_exists"; what `check` throws.
  ImageRecord ChangeImage(const std::string& collection, const std::string& id,
                          const ImageChange& change);
  ObjectRecord ChangeObject(const std::string& collection, const std::string& object,
                            const ObjectChange& change);
  // Of what is there; the check may be empty.
  bool Remove(const std::string& collection, const std::string& id, const ImageCheck& check);
  std::uint64_t RemoveObject(const std::string& collection, const std::string& object,
                             const ObjectCheck& check);

  std::uint64_t RemoveWhere(const Selection& which);  // how many; at once

  bool CreateCollection(const std::string& name);  // false = it was there
  // With its aliases. false = it was not there. kConflict "collection_is_alias" for an alias.
  bool RemoveCollection(const std::string& name);
  CollectionRecord ChangeCollection(const std::string& name, const CollectionChange& change);
  // All at once, or none. kNotFound "alias_not_found" for one to remove, "collection_not_found";
  // kConflict "collection_exists" for an alias with the name of a collection.
  void ChangeAliases(const AliasChanges& changes);

  // A vocabulary comes in three steps: it is added, not ready yet; images get words of it; it is
  // finished. The last two give words to what lacks them, while nobody adds images.
  Key AddVocabulary(Key collection, const Vocabulary& vocabulary);
  // Gives words of the vocabulary to the images of the collection that lack them, in batches,
  // while others add images. `progress` hears how many have them, before each batch and at the
  // end; what it throws ends the work. `threads`: 0 = all cores.
  void Quantize(Key collection, Key vocabulary, const Quantizer& quantizer, int threads,
                const std::function<void(std::uint64_t images)>& progress);
  // Ready, and active where the collection has none. `automatic`: nobody chose it
  // (CollectionRecord).
  VocabularyRecord FinishVocabulary(const std::string& collection, Key vocabulary,
                                    const Quantizer& quantizer, bool automatic);
  // An automatic one does not replace one that somebody has chosen.
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
