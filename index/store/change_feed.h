// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What has changed, whoever wrote it: this process or another. How a ranker in memory follows the
// store: new images have greater versions, removed ones are listed.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "index/records/image_ref.h"
#include "index/store/catalogue.h"
#include "vocab/vocabulary.h"

namespace pliant {

// How far somebody has followed.
struct FeedPosition {
  std::int64_t image = 0;    // the newest version
  std::int64_t removal = 0;  // number of the newest removal
  // Of a database that a standby may take the place of: commits so far, which line of history they
  // are in, and how many there were when it left the one before.
  std::int64_t commit = 0;
  std::int64_t history = 0;
  std::int64_t left_at = 0;

  // Whether nothing that was seen at `before` has been undone since, as what a standby had not
  // received is when it takes the place of a primary.
  bool Continues(const FeedPosition& before) const {
    if (history == before.history) return commit >= before.commit;
    return history == before.history + 1 && left_at >= before.commit;
  }
};

// One consistent state of the store. For one thread; keep it short.
class FeedView {
 public:
  virtual ~FeedView() = default;

  virtual FeedPosition Position() = 0;
  virtual std::vector<CollectionState> Collections() = 0;
  // Versions that were removed after that position, of all collections. nullopt: the store has
  // forgotten some of them, or does not continue from there; only loading all again tells.
  virtual std::optional<std::vector<std::int64_t>> RemovedSince(const FeedPosition& at) = 0;
  virtual std::shared_ptr<const Vocabulary> ReadVocabulary(Key vocabulary) = 0;
  virtual std::uint64_t CountImages(Key collection) = 0;
  // Images that have words of the vocabulary, of `words` words, with versions above `after`,
  // ascending, at most `chunk` at a time.
  virtual void ForEachImage(Key vocabulary, std::size_t words, std::int64_t after,
                            std::size_t chunk,
                            const std::function<void(std::vector<IndexedImage>)>& work) = 0;
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
