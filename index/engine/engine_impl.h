// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What stands behind the facade: how images are described, quantised, searched; where they are
// kept and how they are ranked is behind the interfaces of store/ and rank/. Private to engine/.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "index/engine/engine.h"
#include "index/rank/memory_ranker.h"
#include "index/store/store.h"

namespace pliant {

class Engine::Impl {
 public:
  explicit Impl(EngineOptions options);

  Catalogue& catalogue() { return store_->catalogue(); }
  Writer& writer() { return store_->writer(); }
  // Of the collection with this name or alias.
  CollectionView View(const std::string& collection) {
    return ranker_->View(catalogue().RequireCollection(collection).name);
  }

  // Images (engine_images.cc)
  std::function<AddResult()> BeginAdd(const AddRequest& request, const ImageCheck& check);
  ImageRecord Get(const std::string& collection, const std::string& id);
  Features GetFeatures(const std::string& collection, const std::string& id) {
    return GetFeatures({catalogue().RequireCollection(collection).key, id}, collection);
  }
  void ForEachFeatures(const ImageListing& list, const std::function<void(const ImagePage&)>& look,
                       const std::function<void(const ImageRecord&, const Features&)>& take);
  DescriptorInfo Model() const { return store_->model().info; }
  ImageRecord Change(const std::string& collection, const std::string& id,
                     const ImageChange& change);
  ObjectRecord ChangeObject(const std::string& collection, const std::string& object,
                            const ObjectChange& change);

  // Collections
  bool CreateCollection(const std::string& name);
  bool RemoveCollection(const std::string& name);
  void ChangeAliases(const AliasChanges& changes);

  // Search (engine_search.cc, search_run.h)
  SearchResult Search(Bytes encoded, const SearchOptions& options);
  SearchResult SearchStored(const std::string& image_id, const SearchOptions& options);
  SearchResult SearchFeatures(const Features& features, const SearchOptions& options,
                              const SecondPass& second);
  std::optional<Features> DescribeFiner(Bytes encoded, const Features& known, int threads) {
    return query_extractor().ExtractSecondPass(encoded, known, {}, threads);
  }
  SearchResult SearchExamples(const std::vector<std::string>& image_ids,
                              const SearchOptions& options);
  Comparison Compare(Bytes first, Bytes second, int threads);

  // Locating
  ObjectLocation Locate(Bytes encoded, const std::string& collection, const std::string& object,
                        int threads);

  // Vocabularies (engine_vocabularies.cc)
  VocabularyRecord TrainVocabulary(const TrainOptions& options);
  void UseVocabulary(const std::string& collection, std::int64_t id, const UseOptions& options);

  // Upkeep (engine.cc)
  EngineStats Stats();
  std::vector<std::string> Check();

 private:
  // The descriptor, made when first needed; kConflict when it differs from the database's. For
  // images to index, and for those to search with, of which every detail may be the one.
  const FeatureExtractor& extractor() { return extractors().indexed; }
  const FeatureExtractor& query_extractor() { return extractors().query; }
  struct Extractors {
    FeatureExtractor indexed;
    FeatureExtractor query;
  };
  const Extractors& extractors();
  void CheckModel(const DescriptorInfo& info) const;
  // Makes `extraction` follow what the database has written down; kConflict "extraction_mismatch".
  void FollowLimits(const ExtractionLimits& stored, ExtractionOptions& extraction) const;
  // The same, once it is written down where that was not decided yet. Not before an image is
  // described: who only looks into a database decides nothing.
  void SettleLimits(ExtractionOptions& extraction);

  // Everything about a new image that takes time.
  ImagePut Prepare(const AddRequest& request, const std::string& sha256, AddTimings* timings);
  Features GetFeatures(const ImageRef& ref, const std::string& collection);
  // kConflict "no_vocabulary". Where nothing is found and `second` has more features, these verify
  // the same ranking once more; the answer whose first hit has more evidence.
  SearchResult Answer(const CollectionView& view, Features features, const SearchOptions& options,
                      const ExtractionTimings& timings, const SecondPass& second = {});
  std::vector<ImageRef> ImagesOf(const std::string& collection, const std::string& object);
  std::vector<ImageRef> MostSimilar(const Features& query, const std::string& collection,
                                    const std::string& object, int threads,
                                    std::vector<ImageRef> some);
  // Gives words of `vocabulary` to all images that lack them. `progress` hears of the share done.
  void QuantizeMissing(Key collection, Key vocabulary, const Quantizer& quantizer, int threads,
                       const std::stop_token& stop, const std::function<void(double)>& progress);
  void DropUnfinished(Key vocabulary) noexcept;
  void Follow();  // after a commit; what goes wrong is told to options_.warn and thrown
  VocabularyRecord StoreVocabulary(const CollectionState& collection,
                                   const std::shared_ptr<const Vocabulary>& vocabulary,
                                   const TrainOptions& options);

  EngineOptions options_;
  std::mutex extractors_mutex_;  // guards the making of extractors_
  std::unique_ptr<const Extractors> extractors_;
  bool limits_settled_ = false;  // guarded by it, too, once the constructor is done
  std::unique_ptr<Store> store_;
  std::unique_ptr<MemoryRanker> ranker_;  // follows store_, and goes first
  std::mutex training_mutex_;             // one training at a time
  std::jthread follower_;                 // last: it uses the ranker
};

}  // namespace pliant
