// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The writer on a database file. Private to store/sqlite.
#pragma once

#include "index/store/sqlite/access.h"
#include "index/store/sqlite/catalogue.h"
#include "index/store/sqlite/originals_keeper.h"
#include "index/store/writer.h"

namespace pliant {

class SqliteWriter : public Writer {
 public:
  SqliteWriter(Access* access, OriginalsKeeper* originals, const ModelRow* model)
      : access_(*access), originals_(*originals), model_(*model) {}

  std::vector<PutOutcome> PutAll(std::span<const PicturePut> puts) override;
  void RestoreContent(const ImageRecord& stored, Bytes bytes) override {
    originals_.Restore(stored, bytes);
  }
  // sqlite_changes.cc
  ImageRecord ChangePicture(const std::string& collection, const std::string& id,
                            const PictureChange& change) override;
  ObjectRecord ChangeObject(const std::string& collection, const std::string& object,
                            const ObjectChange& change) override;
  bool Remove(const std::string& collection, const std::string& id,
              const PictureCheck& check) override;
  std::uint64_t RemoveObject(const std::string& collection, const std::string& object,
                             const ObjectCheck& check) override;
  std::uint64_t RemoveWhere(const Selection& which) override;
  bool CreateCollection(const std::string& name) override;
  bool RemoveCollection(const std::string& name) override;
  CollectionRecord ChangeCollection(const std::string& name,
                                    const CollectionChange& change) override;
  void ChangeAliases(const AliasChanges& changes) override;

  Key AddVocabulary(Key collection, const Vocabulary& vocabulary) override;
  void AddWords(Key vocabulary, std::span<const PictureWords> pictures) override;
  VocabularyRecord FinishVocabulary(const std::string& collection, Key vocabulary,
                                    const Quantizer& quantizer, bool automatic) override;
  void SetActiveVocabulary(const std::string& collection, Key vocabulary,
                           const Quantizer& quantizer, bool automatic) override;
  void DropVocabulary(Key vocabulary) override;

  std::uint64_t SweepOriginals() override { return originals_.Sweep(); }
  MoveOriginalsResult MoveOriginals(const std::filesystem::path& directory,
                                    const std::function<void(double)>& progress) override {
    return originals_.Move(directory, progress);
  }

 private:
  PutOutcome Store(Connection& db, const PicturePut& put, IncomingOriginal* original) const;
  static void CheckObjectNow(Connection& db, Key collection, const ObjectRecord& now,
                             const ObjectCheck& check);

  Access& access_;
  OriginalsKeeper& originals_;
  const ModelRow& model_;
};

}  // namespace pliant
