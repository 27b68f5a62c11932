// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What has changed, whoever wrote it: this process or another. How a ranker in memory follows the
// store: new pictures have greater versions, removed ones are listed.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "index/records/indexed_picture.h"
#include "index/store/catalogue.h"
#include "vocab/vocabulary.h"

namespace pliant {

// How far somebody has followed.
struct FeedPosition {
  std::int64_t picture = 0;  // the newest version
  std::int64_t removal = 0;  // number of the newest removal
};

// One consistent state of the store. For one thread; keep it short.
class FeedView {
 public:
  virtual ~FeedView() = default;

  virtual FeedPosition Position() = 0;
  virtual std::vector<CollectionState> Collections() = 0;
  // Versions that went after that removal, of all collections. nullopt: the store has forgotten
  // some of them, so that only loading anew tells what is gone.
  virtual std::optional<std::vector<std::int64_t>> RemovedSince(std::int64_t removal) = 0;
  virtual std::shared_ptr<const Vocabulary> ReadVocabulary(Key vocabulary) = 0;
  virtual std::uint64_t CountPictures(Key collection) = 0;
  // Pictures that have words of the vocabulary, of `words` words, with versions above `after`,
  // ascending, at most `chunk` at a time.
  virtual void ForEachPicture(Key vocabulary, std::size_t words, std::int64_t after,
                              std::size_t chunk,
                              const std::function<void(std::vector<IndexedPicture>)>& work) = 0;
};

// Thread-safe. Throws what a database throws.
class ChangeFeed {
 public:
  virtual ~ChangeFeed() = default;

  // Differs from what it was whenever somebody has committed in between. Cheap: every search asks.
  virtual std::int64_t Version() = 0;
  virtual std::unique_ptr<FeedView> Look() = 0;
};

}  // namespace pliant
