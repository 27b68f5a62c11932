// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The searchable state of all collections, kept in line with the database, whoever wrote it: this
// process or another. Private to index/.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "index/rank/inverted_index.h"
#include "index/store/sqlite/catalogue.h"
#include "vocab/quantizer.h"

namespace pliant {

// One collection as a search sees it; everything in it belongs together.
struct CollectionView {
  Key collection = 0;
  Key vocabulary = 0;  // 0 = none is active
  std::shared_ptr<const Quantizer> quantizer;
  std::shared_ptr<const IndexSnapshot> snapshot;
};

class IndexState {
 public:
  // `loading` hears which share of the pictures is loaded; may be empty.
  explicit IndexState(std::unique_ptr<Connection> watch, std::function<void(double)> loading = {})
      : watch_(std::move(watch)), loading_(std::move(loading)) {}

  // Looks whether anybody has committed since the last call (PRAGMA data_version) and follows:
  // new pictures are those with greater keys, removed ones are in the table `removals`, another
  // active vocabulary is loaded anew. Thread-safe; throws what the database throws and kCorrupt.
  void CatchUp();
  void CatchUpIfLoaded();  // nothing before the first CatchUp

  // kNotFound for an unknown collection. Thread-safe.
  CollectionView Find(const std::string& collection) const;

  std::size_t memory_bytes() const;
  // Differences between memory and database, as sentences, after a catch-up.
  std::vector<std::string> Compare();

 private:
  struct Collection {
    Key key = 0;
    Key vocabulary = 0;
    std::shared_ptr<const Quantizer> quantizer;
    std::shared_ptr<InvertedIndex> index;
  };
  using Collections = std::map<std::string, Collection>;

  void CatchUpLocked();
  void Follow();
  // `progress` hears how many more pictures are loaded.
  Collection Load(const CollectionRow& row, const std::function<void(std::size_t)>& progress);
  // Words of the pictures with keys above `after`, a segment's worth at a time.
  void ForEachChunk(Key vocabulary, std::size_t words, Key after,
                    const std::function<void(std::vector<IndexedPicture>)>& work);

  std::mutex update_mutex_;  // guards watch_ and all up to collections_mutex_; held while following
  std::unique_ptr<Connection> watch_;
  std::function<void(double)> loading_;  // only until the first load is complete
  std::int64_t data_version_ = -1;
  Key last_picture_ = 0;
  std::int64_t last_removal_ = 0;
  bool reload_ = true;

  mutable std::mutex collections_mutex_;  // guards collections_; held for a copy only
  std::shared_ptr<const Collections> collections_ = std::make_shared<const Collections>();
};

}  // namespace pliant
