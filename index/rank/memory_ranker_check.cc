// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// MemoryRanker: whether what is in memory is what the database holds.
#include <algorithm>

#include "index/rank/memory_ranker.h"

namespace pliant {

std::vector<std::string> MemoryRanker::Check() {
  struct Compared {
    std::string name;
    Loaded loaded;
    std::shared_ptr<const IndexSnapshot> snapshot;
  };
  std::vector<Compared> compared;
  std::unique_ptr<FeedView> view;
  {
    Lock lock(mutex_);
    in_use_ = true;
    const auto is_stale = [](const auto& entry) { return !entry.second.is_current(); };
    do {
      CatchUp();
      LoadAll(lock);
      view = feed_->Look();  // one state for memory and database
      CatchUpWith(*view);
    } while (std::any_of(entries_.begin(), entries_.end(), is_stale));
    for (const auto& [name, entry] : entries_) {
      if (entry.shown->index) {
        compared.push_back({name, *entry.shown, entry.shown->index->snapshot()});
      }
    }
  }
  std::vector<std::string> problems;
  for (const auto& [name, loaded, snapshot] : compared) {
    std::size_t stored = 0;
    const auto compare = [&, &in_memory = *snapshot](const std::vector<IndexedPicture>& chunk) {
      stored += chunk.size();
      for (const IndexedPicture& picture : chunk) {
        const std::optional<Bow> bow = in_memory.Find(picture.key);
        if (!bow || bow->words != picture.bow.words || bow->codes != picture.bow.codes) {
          problems.push_back("picture \"" + picture.id +
                             "\": index and database differ in its words");
        }
      }
    };
    view->ForEachPicture(loaded.vocabulary, loaded.quantizer->vocabulary().size(), 0,
                         IndexSegment::kMaxPictures, compare);
    if (stored != snapshot->pictures) {
      problems.push_back("collection \"" + name + "\": the index holds " +
                         std::to_string(snapshot->pictures) + " pictures, the database " +
                         std::to_string(stored));
    }
  }
  return problems;
}

}  // namespace pliant
