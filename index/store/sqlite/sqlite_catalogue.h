// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The catalogue on a database file. Private to store/sqlite.
#pragma once

#include "index/store/catalogue.h"
#include "index/store/sqlite/access.h"
#include "index/store/sqlite/catalogue.h"
#include "index/store/sqlite/originals_keeper.h"

namespace pliant {

class SqliteCatalogue : public Catalogue {
 public:
  SqliteCatalogue(Access* access, OriginalsKeeper* originals, const ModelRow* model)
      : access_(*access), originals_(*originals), model_(*model) {}

  std::vector<std::string> ListCollections() override;
  std::vector<CollectionLabel> ListLabels() override;
  std::vector<AliasRecord> ListAliases() override;
  CollectionState RequireCollection(const std::string& name) override;
  CollectionRecord DescribeCollection(const std::string& name) override;
  std::optional<ObjectRecord> FindObject(const std::string& collection,
                                         const std::string& object) override;
  std::vector<ObjectRecord> ListObjects(const std::string& collection, const std::string& after,
                                        int limit) override;

  std::optional<ImageRecord> FindPicture(const std::string& collection,
                                         const std::string& id) override;
  std::optional<ImageRecord> FindBySha256(const std::string& collection,
                                          const std::string& sha256) override;
  std::vector<ImageRecord> ListPictures(const ListOptions& options) override;
  PicturePage ListPicturePage(const PictureListing& list) override;
  void ForEachPicturePage(PictureListing list,
                          const std::function<void(const PicturePage&)>& work) override;
  void ForEachPictureFeatures(
      PictureListing list, const std::function<void(const PicturePage&)>& look,
      const std::function<void(const ImageRecord&, Bytes features)>& take) override;
  ObjectPage ListObjectPage(const ObjectListing& list) override;
  std::optional<ImageRecord> FindUnchanged(const AddRequest& request,
                                           const std::string& sha256) override;
  std::optional<StoredPicture> FindDescribed(const std::string& sha256) override;
  std::vector<std::optional<StoredPicture>> LoadPictures(std::span<const PictureRef> refs,
                                                         Load what) override;
  std::vector<std::uint8_t> ReadContent(const std::string& collection,
                                        const std::string& id) override;
  Admission Admit(Key collection, const std::optional<std::string>& object, const Filter& filter,
                  const std::vector<std::string>& without) override;

  std::vector<VocabularyRecord> ListVocabularies(const std::string& collection) override;
  std::optional<VocabularyRecord> FindVocabulary(const std::string& collection,
                                                 Key vocabulary) override;
  std::shared_ptr<const Vocabulary> ReadVocabulary(Key vocabulary) override;
  std::uint64_t CountPictures(Key collection) override;
  std::uint64_t CountUnquantized(const std::string& collection, Key vocabulary) override;
  std::vector<StoredFeatures> LoadUnquantized(Key collection, Key vocabulary, std::int64_t after,
                                              int limit) override;
  DescriptorSample SampleDescriptors(Key collection, std::size_t count,
                                     std::uint64_t seed) override;

  EngineStats Count() override;
  std::vector<std::string> Check() override;
  void Backup(const std::filesystem::path& target, const std::stop_token& stop) override;
  std::optional<OriginalsRecord> DescribeOriginals() override { return originals_.Describe(); }

 private:
  Access& access_;
  OriginalsKeeper& originals_;
  const ModelRow& model_;
};

// In the transaction of `db`.
std::optional<ImageRecord> FindUnchangedIn(Connection& db, Key collection,
                                           const AddRequest& request, const std::string& sha256);
std::vector<StoredFeatures> LoadUnquantizedIn(Connection& db, Key collection, Key vocabulary,
                                              std::int64_t after, int limit);

}  // namespace pliant
