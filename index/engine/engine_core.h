// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Shared by the parts of an engine: description, storage (store/) and ranking (rank/) of images.
// Private to engine/.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "index/engine/engine.h"
#include "index/engine/part_ranking.h"
#include "index/rank/memory_ranker.h"
#include "index/store/store.h"

namespace pliant {

class EngineCore {
 public:
  explicit EngineCore(EngineOptions options);
  ~EngineCore();
  EngineCore(const EngineCore&) = delete;
  EngineCore& operator=(const EngineCore&) = delete;

  Catalogue& catalogue() { return store_->catalogue(); }
  Writer& writer() { return store_->writer(); }
  MemoryRanker& ranker() { return *ranker_; }
  const DescriptorInfo& model() const { return store_->model().info; }
  bool keeps_originals() const { return options_.keep_originals; }
  // kConflict "model_mismatch" for features of another model or form than the database's.
  void CheckFeatures(const Features& features) const;
  // The view of the collection with this name or alias.
  CollectionView View(const std::string& collection) {
    return ranker_->View(catalogue().RequireCollection(collection).name);
  }
  // Of the whole index, in whatever processes it is.
  Ranking Rank(const CollectionView& view, const RankQuery& query, const RankOptions& options);
  PartAnswers& part_answers() { return part_answers_; }
  const std::string& database() const { return database_; }
  const EngineOptions& options() const { return options_; }
  // Of a stored image; kNotFound "image_not_found".
  Features GetFeatures(const ImageRef& ref, const std::string& collection);

  // The descriptor, made when first needed; kConflict if it differs from the database's. One
  // extractor for stored images, and one for queries, which finds more detail.
  const FeatureExtractor& extractor() { return extractors().indexed; }
  const FeatureExtractor& query_extractor() { return extractors().query; }

 private:
  struct Extractors {
    FeatureExtractor indexed;
    FeatureExtractor query;
  };
  const Extractors& extractors();
  void CheckModel(const DescriptorInfo& info) const;
  // Sets `extraction` to the values stored in the database; kConflict "extraction_mismatch".
  void FollowLimits(const ExtractionLimits& stored, ExtractionOptions& extraction) const;
  // The same, after storing values that the database does not have yet. Called before the first
  // image is described. A read-only engine stores nothing.
  void StoreLimits(ExtractionOptions& extraction);
  Ranking RankParts(const CollectionView& view, const RankQuery& query, const RankOptions& options);
  void Follow();  // after a commit; reports a failure to options_.warn, and throws it

  EngineOptions options_;
  std::mutex extractors_mutex_;  // guards the making of extractors_
  std::unique_ptr<const Extractors> extractors_;
  bool limits_stored_ = false;  // also guarded by it, after the constructor
  std::unique_ptr<Store> store_;
  std::unique_ptr<MemoryRanker> ranker_;  // follows store_; destroyed before it
  std::string database_;                  // Store::Identity, for an index in parts
  PartAnswers part_answers_;
  std::jthread follower_;  // last: it uses the ranker
};

}  // namespace pliant
