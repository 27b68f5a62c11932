// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the faces of an engine share: how images are described, where they are kept (store/) and
// how they are ranked (rank/). Private to engine/.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "index/engine/engine.h"
#include "index/rank/memory_ranker.h"
#include "index/store/store.h"

namespace pliant {

class EngineCore {
 public:
  explicit EngineCore(EngineOptions options);

  Catalogue& catalogue() { return store_->catalogue(); }
  Writer& writer() { return store_->writer(); }
  MemoryRanker& ranker() { return *ranker_; }
  const DescriptorInfo& model() const { return store_->model().info; }
  bool keeps_originals() const { return options_.keep_originals; }
  // Of the collection with this name or alias.
  CollectionView View(const std::string& collection) {
    return ranker_->View(catalogue().RequireCollection(collection).name);
  }
  // Of a stored image; kNotFound "image_not_found".
  Features GetFeatures(const ImageRef& ref, const std::string& collection);

  // The descriptor, made when first needed; kConflict when it differs from the database's. For
  // images to index, and for those to search with, of which every detail may be the one.
  const FeatureExtractor& extractor() { return extractors().indexed; }
  const FeatureExtractor& query_extractor() { return extractors().query; }

 private:
  struct Extractors {
    FeatureExtractor indexed;
    FeatureExtractor query;
  };
  const Extractors& extractors();
  void CheckModel(const DescriptorInfo& info) const;
  // Makes `extraction` follow what the database has written down; kConflict "extraction_mismatch".
  void FollowLimits(const ExtractionLimits& stored, ExtractionOptions& extraction) const;
  // The same, once it is written down where that was not decided yet. Not before an image is
  // described: a read-only engine decides nothing.
  void SettleLimits(ExtractionOptions& extraction);
  void Follow();  // after a commit; what goes wrong is told to options_.warn and thrown

  EngineOptions options_;
  std::mutex extractors_mutex_;  // guards the making of extractors_
  std::unique_ptr<const Extractors> extractors_;
  bool limits_settled_ = false;  // guarded by it, too, once the constructor is done
  std::unique_ptr<Store> store_;
  std::unique_ptr<MemoryRanker> ranker_;  // follows store_, and goes first
  std::jthread follower_;                 // last: it uses the ranker
};

}  // namespace pliant
