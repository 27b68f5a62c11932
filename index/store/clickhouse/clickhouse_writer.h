// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Changes of a cluster. Private to store/clickhouse.
#pragma once

#include <memory>
#include <string>

#include "index/store/clickhouse/clickhouse_catalogue.h"
#include "index/store/clickhouse/cluster_commits.h"
#include "index/store/writer.h"

namespace pliant::clickhouse {

class ClickhouseWriter : public Writer {
 public:
  ClickhouseWriter(ClusterLink* link, ClusterCommits* commits, ClickhouseCatalogue* catalogue)
      : link_(*link), commits_(*commits), catalogue_(*catalogue) {}

  std::vector<PutOutcome> PutAll(std::span<const PicturePut> puts) override;
  void RestoreContent(const ImageRecord& stored, Bytes bytes) override;
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

  std::uint64_t SweepOriginals() override { return 0; }
  MoveOriginalsResult MoveOriginals(const std::filesystem::path& directory,
                                    const std::function<void(double)>& progress) override;

 private:
  PutOutcome Store(Change& change, const PicturePut& put);
  // Outlines of what is selected, under the lock; the work must be alone.
  std::vector<PictureOutline> SelectNow(Change& change, const Selection& which);
  void QuantizeRest(Change& change, std::uint32_t collection, Key vocabulary,
                    const Quantizer& quantizer);

  ClusterLink& link_;
  ClusterCommits& commits_;
  ClickhouseCatalogue& catalogue_;
};

}  // namespace pliant::clickhouse
