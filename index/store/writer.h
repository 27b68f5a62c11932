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

#include "index/records/changes.h"
#include "index/records/listing.h"
#include "index/records/picture_ref.h"
#include "index/records/records.h"
#include "vocab/quantizer.h"

namespace pliant {

// A picture with everything about it that takes time, worked out before the writer's turn.
struct PicturePut {
  const AddRequest& request;  // outlives the put
  ImageRecord record = {};
  std::vector<std::uint8_t> encoded = {};  // features (feature_codec.h)
  Features features = {};                  // the same, in stored precision
  Key vocabulary = 0;  // that made `bow`; another is active by now: quantised anew
  Bow bow = {};
  bool keep_content = true;  // the uploaded bytes too
  PictureCheck check = {};   // of the picture that has the id
  bool keep_times = false;   // those of the record: a copy of another database's picture
};

struct PutOutcome {
  AddOutcome outcome = AddOutcome::kCreated;
  ImageRecord image;
};

struct PictureWords {
  std::int64_t version = 0;  // PictureRef::version
  Bow bow;
};

class Writer {
 public:
  virtual ~Writer() = default;

  // Looks once more whether the same is stored already: kUnchanged. What `put.check` throws.
  PutOutcome Put(const PicturePut& put) { return PutAll({&put, 1}).front(); }
  // In one commit, in this order: all, or none where one of them throws. An outcome for each.
  virtual std::vector<PutOutcome> PutAll(std::span<const PicturePut> puts) = 0;
  // The bytes of a stored picture, where its file has been lost.
  virtual void RestoreContent(const ImageRecord& stored, Bytes bytes) = 0;
  // The picture, or the object, as it is then. Features, words and bytes stay. kNotFound
  // "image_not_found", "object_not_found"; kInvalidArgument "metadata_invalid"; kConflict
  // "object_exists"; what `check` throws.
  virtual ImageRecord ChangePicture(const std::string& collection, const std::string& id,
                                    const PictureChange& change) = 0;
  virtual ObjectRecord ChangeObject(const std::string& collection, const std::string& object,
                                    const ObjectChange& change) = 0;
  // Of what is there; the check may be empty.
  virtual bool Remove(const std::string& collection, const std::string& id,
                      const PictureCheck& check) = 0;
  virtual std::uint64_t RemoveObject(const std::string& collection, const std::string& object,
                                     const ObjectCheck& check) = 0;

  virtual std::uint64_t RemoveWhere(const Selection& which) = 0;  // how many; at once

  virtual bool CreateCollection(const std::string& name) = 0;  // false = it was there
  // With its aliases. false = it was not there. kConflict "collection_is_alias" for an alias.
  virtual bool RemoveCollection(const std::string& name) = 0;
  virtual CollectionRecord ChangeCollection(const std::string& name,
                                            const CollectionChange& change) = 0;
  // All at once, or none. kNotFound "alias_not_found" for one to remove, "collection_not_found";
  // kConflict "collection_exists" for an alias with the name of a collection.
  virtual void ChangeAliases(const AliasChanges& changes) = 0;

  // A vocabulary comes in three steps: it is added, not ready yet; pictures get words of it; it is
  // finished. The last two give words to what lacks them, while nobody adds pictures.
  virtual Key AddVocabulary(Key collection, const Vocabulary& vocabulary) = 0;
  // Does nothing for pictures that are gone.
  virtual void AddWords(Key vocabulary, std::span<const PictureWords> pictures) = 0;
  // Ready, and active where the collection has none. `automatic`: nobody chose it
  // (CollectionRecord).
  virtual VocabularyRecord FinishVocabulary(const std::string& collection, Key vocabulary,
                                            const Quantizer& quantizer, bool automatic) = 0;
  // An automatic one does not replace one that somebody has chosen.
  virtual void SetActiveVocabulary(const std::string& collection, Key vocabulary,
                                   const Quantizer& quantizer, bool automatic) = 0;
  virtual void DropVocabulary(Key vocabulary) = 0;

  // Originals in files: see Engine.
  virtual std::uint64_t SweepOriginals() = 0;
  virtual MoveOriginalsResult MoveOriginals(const std::filesystem::path& directory,
                                            const std::function<void(double)>& progress) = 0;
};

}  // namespace pliant
