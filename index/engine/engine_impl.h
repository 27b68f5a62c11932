// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What stands behind the facade. Private to index/.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "index/engine/engine.h"
#include "index/store/sqlite/catalogue.h"
#include "index/store/sqlite/connection.h"
#include "index/store/sqlite/index_state.h"
#include "index/store/sqlite/originals.h"
#include "index/store/sqlite/sqlite_error.h"
#include "index/store/sqlite/write_queue.h"
#include "index/verify/rerank.h"

namespace pliant {

class Engine::Impl {
 public:
  explicit Impl(EngineOptions options);

  // Pictures (engine_pictures.cc)
  AddResult Add(const AddRequest& request);
  std::vector<ImageRecord> List(const ListOptions& options);
  bool Remove(const std::string& collection, const std::string& id);
  std::uint64_t RemoveObject(const std::string& collection, const std::string& object);
  bool CreateCollection(const std::string& name);
  bool RemoveCollection(const std::string& name);
  Features GetFeatures(const std::string& collection, const std::string& id);
  PictureRow RequirePicture(Connection& db, const std::string& collection, const std::string& id);

  // Search (engine_search.cc)
  SearchResult Search(Bytes encoded, const SearchOptions& options);
  SearchResult SearchStored(const std::string& image_id, const SearchOptions& options);
  SearchResult SearchFeatures(const Features& features, const SearchOptions& options);

  // Locating (engine_locate.cc)
  ObjectLocation Locate(Bytes encoded, const std::string& collection, const std::string& object,
                        int threads);

  // Vocabularies (engine_vocabularies.cc)
  VocabularyRecord TrainVocabulary(const TrainOptions& options);
  void UseVocabulary(const std::string& collection, std::int64_t id, const UseOptions& options);

  // Originals (engine_originals.cc)
  std::vector<std::uint8_t> GetContent(const std::string& collection, const std::string& id);
  std::uint64_t SweepOriginals();
  MoveOriginalsResult MoveOriginals(const std::filesystem::path& directory,
                                    const std::function<void(double)>& progress);
  std::optional<OriginalsRecord> DescribeOriginals();

  // Upkeep (engine.cc)
  EngineStats Stats();
  std::vector<std::string> Check();

  // Runs `work` in a read transaction on a connection of the pool.
  template <typename Work>
  auto Read(Work&& work) {
    return WithDatabaseErrors(options_.database, [&] {
      const ConnectionPool::Lease db = readers_->Borrow();
      const SQLite::Transaction reading(db->database());
      return work(*db);
    });
  }
  // Runs `work` in the writer's transaction; see WriteQueue::Run.
  void Write(WriteQueue::Work work, bool reclaim = false);

  const std::filesystem::path& path() const { return options_.database; }

 private:
  struct Prepared;  // engine_pictures.cc

  // The descriptor, made when first needed; kConflict when it differs from the database's.
  const FeatureExtractor& extractor();
  void CheckModel(const DescriptorInfo& info) const;
  // Makes options_.extraction the database's; writes it down where it is not decided yet.
  void SettleExtraction();
  CollectionView CurrentView(const std::string& collection);
  // Which pictures `options` admit, by key and object; empty = all.
  std::function<bool(Key, Key)> Admitted(const SearchOptions& options, Key collection);

  std::optional<ImageRecord> FindUnchanged(Connection& db, const CollectionRow& collection,
                                           const AddRequest& request, const std::string& sha256);
  Prepared Prepare(const AddRequest& request, const std::string& sha256);
  AddResult Store(Connection& db, const AddRequest& request, const Prepared& prepared);

  void OpenOriginals();
  // Writes the file of a stored picture again if it has been lost.
  void RestoreOriginal(const ImageRecord& stored, Bytes bytes);
  // After a commit that removed or replaced pictures; the second never fails.
  void RemoveDroppedOriginals();
  void TidyOriginals();
  void ForgetOriginal(const std::string& sha256);  // after a failed transaction; never fails
  std::vector<std::string> CheckOriginals();
  std::optional<OriginalStore> PresentStore(Connection& db);  // where files are at the moment

  std::vector<std::string> MostSimilar(const Features& query, const std::string& collection,
                                       const std::string& object, int threads,
                                       std::vector<std::string> some);
  SearchResult Answer(Features features, const SearchOptions& options,
                      const ExtractionTimings& timings);
  // Reads pictures' features; nothing for one that was removed since the snapshot.
  std::function<std::optional<Features>(Key)> Loader(const std::string& model_id);
  std::vector<VerifiedPicture> Verify(const Features& query, const SearchOptions& options,
                                      std::vector<RankedPicture> candidates);
  void ExpandBy(const CollectionView& view, const Features& query, const Bow& bow,
                const SearchOptions& options, const RankOptions& rank,
                std::vector<VerifiedPicture>* hits, Ranking* ranking);
  void AddHits(std::vector<VerifiedPicture>& best, const SearchOptions& options,
               SearchResult* result);
  // Gives words of `vocabulary` to all pictures that lack them. `work` hears of the share done.
  void QuantizeMissing(Key collection, Key vocabulary, const Quantizer& quantizer, int threads,
                       const std::stop_token& stop, const std::function<void(double)>& progress);
  void DropUnfinished(Key vocabulary) noexcept;
  void QuantizeRest(Connection& db, Key collection, Key vocabulary, const Quantizer& quantizer);

  EngineOptions options_;
  ModelRow model_;
  std::mutex extractor_mutex_;  // guards the making of extractor_
  std::unique_ptr<const FeatureExtractor> extractor_;
  // nullptr when read-only. Dies after the readers: the last connection to close puts the log into
  // the database and removes it, which only a writing one can.
  std::unique_ptr<WriteQueue> writer_;
  std::unique_ptr<ConnectionPool> readers_;
  std::unique_ptr<IndexState> state_;
  Originals originals_;
  std::mutex training_mutex_;  // one training at a time
};

}  // namespace pliant
