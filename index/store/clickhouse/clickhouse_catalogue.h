// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The catalogue of a cluster. Private to store/clickhouse.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "index/store/catalogue.h"
#include "index/store/clickhouse/picture_states.h"
#include "index/store/clickhouse/search_reads.h"
#include "index/store/clickhouse/shard_states.h"
#include "index/store/clickhouse/snapshot.h"

namespace pliant::clickhouse {

struct CollectionCounts {
  std::uint64_t images = 0;
  std::uint64_t objects = 0;
  std::uint64_t descriptors = 0;
};

class ClickhouseCatalogue : public Catalogue {
 public:
  // `password`: for Check(), which asks every node.
  ClickhouseCatalogue(ClusterLink* link, Snapshots* snapshots, std::string password)
      : link_(*link), snapshots_(*snapshots), states_(link), password_(std::move(password)) {}

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
  std::optional<OriginalsRecord> DescribeOriginals() override { return std::nullopt; }
  std::size_t CountShards() override { return link_.shards(); }
  std::vector<ShardRecord> ReadShards() override { return ReadShardRecords(link_); }
  std::unique_ptr<PartialSource> Partial() override;

  CollectionRecord Describe(const Snapshot& now, const CollectionEntry& collection);
  // As of `now`.
  std::vector<PictureOutline> Select(const Snapshot& now, const Selection& which);

 private:
  using Counts = std::map<std::uint32_t, CollectionCounts>;  // by collection

  void EachPageAt(const Snapshot& now, PictureListing list,
                  const std::function<void(const PicturePage&)>& work);
  PicturePage PageAt(const Snapshot& now, const PictureListing& list);
  PicturePage PageById(const Snapshot& now, const PictureListing& list);
  std::shared_ptr<const Counts> CountAll(const Snapshot& now);
  std::vector<ImageRecord> RecordsOf(const Snapshot& now, const CollectionEntry& collection,
                                     const std::vector<std::string>& ids);
  void CheckPictures(const Snapshot& now, std::vector<std::string>& problems);

  ClusterLink& link_;
  Snapshots& snapshots_;
  PictureStates states_;
  const std::string password_;
  ReadablePictures readable_;
  std::mutex mutex_;  // guards the rest
  std::uint64_t counted_at_ = 0;
  std::shared_ptr<const Counts> counts_;
};

// The record with its collection's name.
ImageRecord RecordOf(const PictureState& state, const std::string& collection);

// Pictures that have no words of the vocabulary yet, by version: at most `limit` with versions
// after `after`, and as they were at `log`.
std::vector<PictureOutline> Unquantized(PictureStates& states, std::uint32_t collection,
                                        std::uint64_t log, Key vocabulary, std::int64_t after,
                                        int limit);
// Throws kCorrupt "features_missing".
std::vector<StoredFeatures> FeaturesOf(PictureStates& states,
                                       const std::vector<PictureOutline>& pictures);

}  // namespace pliant::clickhouse
