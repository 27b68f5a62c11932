// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The changes of the store by any process. With them a ranker in memory follows the store: new
// images have greater versions, removed images are listed.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "index/records/image_ref.h"
#include "index/store/catalogue.h"
#include "vocab/vocabulary.h"

namespace pliant {

// A position in the feed.
struct FeedPosition {
  std::int64_t image = 0;    // the newest version
  std::int64_t removal = 0;  // number of the newest removal
  // For a database with standbys: the number of commits, their timeline, and the number of commits
  // when the timeline began.
  std::int64_t commit = 0;
  std::int64_t history = 0;
  std::int64_t left_at = 0;

  // Whether all commits seen at `before` still exist. When a standby becomes the primary, commits
  // that it had not received are lost.
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
  // Versions removed after that position, in all collections. nullopt: the store has forgotten some
  // of them, or does not continue from there. Then load everything again.
  virtual std::optional<std::vector<std::int64_t>> RemovedSince(const FeedPosition& at) = 0;
  virtual std::shared_ptr<const Vocabulary> ReadVocabulary(Key vocabulary) = 0;
  virtual std::uint64_t CountImages(Key collection) = 0;  // about those of the share
  // The share's images with words of the vocabulary, which is the quantizer's, with versions above
  // `after`, ascending, at most `chunk` at a time. Their codes are computed, on all cores. `work`
  // is called from another thread while the next images are read, and must not use the view.
  virtual void ForEachImage(Key vocabulary, const Quantizer& quantizer, std::int64_t after,
                            std::size_t chunk,
                            const std::function<void(std::vector<IndexedImage>)>& work) = 0;
  // Whether this state of the store comes after the one at which SignSaved wrote the signature.
  virtual bool IsSigned(Key vocabulary, const std::string& signature) = 0;
};

// Thread-safe. Throws what a database throws.
class ChangeFeed {
 public:
  virtual ~ChangeFeed() = default;

  // Changes with every commit of any process. Cheap: every search calls it.
  virtual std::int64_t Version() = 0;
  virtual std::unique_ptr<FeedView> Poll() = 0;
  // Writes a signature of the images in a vocabulary as they are saved elsewhere, and forgets
  // another one. So a store that was restored from an older copy does not know what was saved
  // later. Throws kReadOnly "read_only".
  virtual void SignSaved(Key vocabulary, const std::string& signature,
                         const std::string& forgotten) = 0;
};

}  // namespace pliant
