// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The ranker in memory: an inverted index per collection, which follows the store's change feed.
// The feed has the changes of all processes.
//
// Searches wait only for each other's poll of the feed and for small changes. One thread does long
// work in the background: loading a collection after a switch of its vocabulary, or whose changes
// the store has forgotten. Meanwhile others use the previous state, to which removals are applied
// too. Without a previous state they wait. Another thread saves large indexes in files.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "index/rank/index_files.h"
#include "index/rank/inverted_index.h"
#include "index/rank/ranking.h"
#include "index/store/catalogue.h"
#include "index/store/change_feed.h"

namespace pliant {

struct MemoryRankerOptions {
  // During the first load, receives the share of the images in memory. Can be empty.
  std::function<void(double)> loading;
  std::shared_ptr<IndexFiles> files;  // nullptr: the index is always built from the store
  std::size_t save_from = 0;          // images: smaller indexes are not saved
  std::function<void(const std::string& failure)> warn;  // of files; can be empty
  // After a switch of the vocabulary, for three times as long as loading took: other processes that
  // hold parts of the index may need longer.
  bool keep_previous = false;
};

// Thread-safe. Throws what a database throws.
class MemoryRanker {
 public:
  explicit MemoryRanker(std::unique_ptr<ChangeFeed> feed, MemoryRankerOptions options = {});

  // The present state: with all writes of this process and, unless a collection is just being
  // reloaded, of others. kNotFound "collection_not_found".
  CollectionView View(const std::string& collection);
  // The state in this vocabulary, the active one or the previous one: nullopt if it is not loaded.
  std::optional<CollectionView> ViewIn(Key vocabulary, const std::string& collection);
  // The state in the previous vocabulary, while it is kept.
  std::optional<CollectionView> Previous(const std::string& collection);
  // Loads everything, so that the first search does not wait.
  void Load();
  // Call it after each commit of this process, before its writer returns: later views show the
  // commit. Does nothing before the first load.
  void Follow();
  // Preloads the data for a switch to this vocabulary, so that the switch itself takes no time.
  // Kept as long as the result.
  [[nodiscard]] std::shared_ptr<const void> Prepare(Key collection, Key vocabulary);
  // From now on saves in the files what many changes have made. Call it once, and only if the store
  // can be written. Failures are warnings.
  void BeginSaving();
  // The same now, for any change, so that the next start is fast.
  void Save();

  std::size_t memory_bytes() const;
  // ChangeFeed::Version when it last caught up with the store; 0 = never. Never waits.
  std::int64_t followed() const { return followed_; }
  // Differences between the ranker and the store, as sentences.
  std::vector<std::string> Check();

 private:
  using Clock = std::chrono::steady_clock;

  // Words of one collection in one vocabulary, at a position of the feed.
  struct Loaded {
    Key collection = 0;
    Key vocabulary = 0;  // 0 = none: nothing to load
    std::shared_ptr<const Quantizer> quantizer = {};
    std::shared_ptr<InvertedIndex> index = {};
    FeedPosition at;
    std::optional<FeedPosition> saved = {};  // where it was saved last, if it could be
    Clock::duration took{};                  // to load it
  };
  struct Entry {
    Key collection = 0;
    Key vocabulary = 0;           // the active one in the store
    std::optional<Loaded> shown;  // used by searches; absent before the first load
    bool loading = false;         // by one thread, in the background
    std::optional<Loaded> previous;
    Clock::time_point previous_until;

    bool is_current() const { return shown && shown->vocabulary == vocabulary; }
  };
  using Lock = std::unique_lock<std::mutex>;

  // All with mutex_ held.
  void CatchUp();
  void CatchUpWith(FeedView& view);
  Entry Updated(Entry entry, const CollectionState& state, FeedView& view);
  // False: the store has forgotten some removals.
  static bool BringUpToDate(Loaded& loaded, FeedView& view);
  std::optional<Loaded> TakePrepared(Key collection, Key vocabulary);
  void Show(Loaded loaded, Entry* entry) const;
  void LoadEntry(const std::string& name, Lock& lock);  // releases the lock while it loads
  void LoadAll(Lock& lock);
  static CollectionView ViewOf(const std::string& name, const Loaded& loaded);
  // One that has at least so many changes that are not saved.
  Loaded* Unsaved(std::int64_t changes);

  // Without mutex_.
  Loaded LoadAside(FeedView& view, Key collection, Key vocabulary);
  std::optional<IndexFiles::Saved> ReadFiles(FeedView& view, Key vocabulary,
                                             std::size_t words) const;
  void SaveWhile(const std::function<Loaded*(Lock& lock)>& next);
  void Progress(std::size_t images);

  const std::unique_ptr<ChangeFeed> feed_;
  const MemoryRankerOptions options_;

  mutable std::mutex mutex_;  // guards all up to progress_; held while small changes are applied
  std::condition_variable changed_;  // an entry is no longer loading
  std::condition_variable_any followed_more_;
  std::map<std::string, Entry> entries_;
  std::atomic<std::int64_t> followed_ = 0;
  std::optional<std::int64_t> version_;  // of the feed that entries_ follow; absent: unknown
  bool in_use_ = false;                  // after the first load or view
  std::vector<std::weak_ptr<const Loaded>> prepared_;

  std::mutex progress_mutex_;            // guards the rest
  std::function<void(double)> loading_;  // only until the first load is complete
  std::uint64_t to_load_ = 0;
  std::uint64_t loaded_ = 0;

  std::jthread saver_;  // last: it uses the others
};

}  // namespace pliant
