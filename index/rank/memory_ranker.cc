// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/memory_ranker.h"

#include <algorithm>
#include <future>
#include <unordered_map>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "index/store/refusals.h"

namespace pliant {

// Changes that are saved while others are made: a start applies the ones that are not.
constexpr std::int64_t kSaveEvery = InvertedIndex::kMostAtOnce;

// Codes of the same descriptors. Processors round differently, and files of the index come from
// others.
static bool AreAlike(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b) {
  if (a.size() != b.size()) return false;
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) different += a[i] == b[i] ? 0U : 1U;
  return different * 100 <= a.size();
}

MemoryRanker::MemoryRanker(std::unique_ptr<ChangeFeed> feed, MemoryRankerOptions options)
    : feed_(std::move(feed)), options_(std::move(options)), loading_(options_.loading) {}

void MemoryRanker::BeginSaving() {
  if (!options_.files) return;
  saver_ = std::jthread([this](const std::stop_token& stop) {
    SaveWhile([&](Lock& lock) -> Loaded* {
      const auto is_due = [this] { return Unsaved(kSaveEvery) != nullptr; };
      return followed_more_.wait(lock, stop, is_due) ? Unsaved(kSaveEvery) : nullptr;
    });
  });
}

CollectionView MemoryRanker::View(const std::string& collection) {
  Lock lock(mutex_);
  in_use_ = true;
  while (true) {
    CatchUp();
    const auto found = entries_.find(collection);
    if (found == entries_.end()) throw refusals::NoCollection(collection);
    const Entry& entry = found->second;
    if (entry.is_current() || (entry.shown && entry.loading))
      return ViewOf(collection, *entry.shown);
    if (entry.loading) {
      changed_.wait(lock);
    } else {
      LoadEntry(collection, lock);
    }
  }
}

std::optional<CollectionView> MemoryRanker::ViewIn(Key vocabulary, const std::string& collection) {
  const Lock lock(mutex_);
  CatchUp();
  const auto found = entries_.find(collection);
  if (found == entries_.end()) return std::nullopt;
  for (const auto& loaded : {found->second.shown, found->second.previous}) {
    if (loaded && loaded->vocabulary == vocabulary) return ViewOf(collection, *loaded);
  }
  return std::nullopt;
}

std::optional<CollectionView> MemoryRanker::Previous(const std::string& collection) {
  const Lock lock(mutex_);
  CatchUp();
  const auto found = entries_.find(collection);
  if (found == entries_.end() || !found->second.previous) return std::nullopt;
  return ViewOf(collection, *found->second.previous);
}

CollectionView MemoryRanker::ViewOf(const std::string& name, const Loaded& loaded) {
  return {name, loaded.collection, loaded.vocabulary, loaded.quantizer,
          loaded.index ? loaded.index->snapshot() : nullptr};
}

void MemoryRanker::Load() {
  Lock lock(mutex_);
  in_use_ = true;
  CatchUp();
  LoadAll(lock);
}

void MemoryRanker::Follow() {
  Lock lock(mutex_);
  if (!in_use_) return;
  CatchUp();
  // Before a writer returns, no collection may still show an old state: an image that it has added
  // has words of the new vocabulary only.
  LoadAll(lock);
}

void MemoryRanker::LoadAll(Lock& lock) {
  while (true) {
    const auto stale = std::find_if(entries_.begin(), entries_.end(),
                                    [](const auto& entry) { return !entry.second.is_current(); });
    if (stale == entries_.end()) break;
    if (stale->second.loading) {
      changed_.wait(lock);
    } else {
      LoadEntry(std::string(stale->first), lock);
    }
    CatchUp();
  }
  const std::lock_guard progress(progress_mutex_);
  loading_ = nullptr;
}

void MemoryRanker::CatchUp() {
  for (auto& [name, entry] : entries_) {
    if (entry.previous && Clock::now() >= entry.previous_until) entry.previous.reset();
  }
  const std::int64_t version = feed_->Version();
  if (version == version_) return;
  const std::unique_ptr<FeedView> view = feed_->Poll();
  CatchUpWith(*view);
  version_ = version;
  followed_ = version;
}

void MemoryRanker::CatchUpWith(FeedView& view) {
  version_.reset();  // until the end is reached without an exception
  std::map<std::string, Entry> next;
  std::uint64_t to_load = 0;
  for (const CollectionState& state : view.Collections()) {
    const auto known = entries_.find(state.name);
    const bool same = known != entries_.end() && known->second.collection == state.key;
    Entry entry;
    entry.collection = state.key;
    if (same) entry = known->second;
    try {
      next.emplace(state.name, Updated(std::move(entry), state, view));
    } catch (...) {
      // The collections before it are up to date.
      if (!entries_.empty()) {
        for (auto& [name, updated] : next) entries_.insert_or_assign(name, std::move(updated));
      }
      throw;
    }
    if (entries_.empty() && state.vocabulary != 0) to_load += view.CountImages(state.key);
  }
  if (entries_.empty()) {
    const std::lock_guard progress(progress_mutex_);
    to_load_ = to_load;
  }
  entries_ = std::move(next);
  followed_more_.notify_one();
  std::erase_if(prepared_, [](const auto& prepared) { return prepared.expired(); });
}

MemoryRanker::Entry MemoryRanker::Updated(Entry entry, const CollectionState& state,
                                          FeedView& view) {
  entry.vocabulary = state.vocabulary;
  // An index that an exception left half changed must not be shown: it is removed first, and put
  // back when it is whole.
  const auto known = entries_.find(state.name);
  if (entry.previous) {
    Loaded previous = *std::exchange(entry.previous, std::nullopt);
    known->second.previous.reset();
    if (BringUpToDate(previous, view)) entry.previous = std::move(previous);
  }
  if (entry.shown && entry.shown->index) {
    Loaded shown = *std::exchange(entry.shown, std::nullopt);
    if (known != entries_.end()) known->second.shown.reset();
    try {
      if (BringUpToDate(shown, view)) entry.shown = std::move(shown);
    } catch (...) {
      // If nothing was changed yet, the old state is still correct.
      if (known != entries_.end() && shown.index->is_whole()) {
        known->second.shown = std::move(shown);
      }
      throw;
    }
  }
  if (entry.is_current()) return entry;
  if (state.vocabulary == 0) {
    entry.shown = Loaded{.collection = state.key, .at = view.Position()};
  } else if (auto prepared = TakePrepared(state.key, state.vocabulary);
             prepared && BringUpToDate(*prepared, view)) {
    Show(*std::move(prepared), &entry);
  }
  return entry;
}

void MemoryRanker::Show(Loaded loaded, Entry* entry) const {
  if (options_.keep_previous && entry->shown && entry->shown->index &&
      entry->shown->vocabulary != loaded.vocabulary) {
    constexpr std::chrono::seconds kLeast{10};
    entry->previous = std::move(entry->shown);
    entry->previous_until = Clock::now() + kLeast + 3 * loaded.took;
  }
  entry->shown = std::move(loaded);
}

// A replaced image is a removal and an addition: both must come in one snapshot, or a search sees
// neither of the two states.
bool MemoryRanker::BringUpToDate(Loaded& loaded, FeedView& view) {
  const auto removed = view.RemovedSince(loaded.at);
  if (!removed) return false;
  const FeedPosition at = view.Position();  // may fail, so before the change
  view.ForEachImage(
      loaded.vocabulary, *loaded.quantizer, loaded.at.image, InvertedIndex::kMostAtOnce,
      [&](std::vector<IndexedImage> chunk) { loaded.index->Stage(std::move(chunk)); });
  loaded.index->Apply({}, *removed);
  loaded.at = at;
  return true;
}

std::optional<MemoryRanker::Loaded> MemoryRanker::TakePrepared(Key collection, Key vocabulary) {
  for (auto at = prepared_.begin(); at != prepared_.end(); ++at) {
    const std::shared_ptr<const Loaded> prepared = at->lock();
    if (!prepared || prepared->collection != collection || prepared->vocabulary != vocabulary) {
      continue;
    }
    prepared_.erase(at);  // once only: the entry owns the index from now on
    return *prepared;
  }
  return std::nullopt;
}

void MemoryRanker::LoadEntry(const std::string& name, Lock& lock) {
  const Key collection = entries_.at(name).collection;
  entries_.at(name).loading = true;
  lock.unlock();
  std::optional<Loaded> loaded;
  std::exception_ptr failure;
  try {
    const std::unique_ptr<FeedView> view = feed_->Poll();
    for (const CollectionState& state : view->Collections()) {
      if (state.key == collection) loaded = LoadAside(*view, collection, state.vocabulary);
    }
  } catch (...) {
    failure = std::current_exception();
  }
  lock.lock();
  const auto entry = entries_.find(name);
  if (entry != entries_.end() && entry->second.collection == collection) {
    entry->second.loading = false;
    if (loaded) Show(*std::move(loaded), &entry->second);
  }
  version_.reset();  // changes during the loading are applied before it is shown
  changed_.notify_all();
  followed_more_.notify_one();
  if (failure) std::rethrow_exception(failure);
}

MemoryRanker::Loaded MemoryRanker::LoadAside(FeedView& view, Key collection, Key vocabulary) {
  const auto begun = Clock::now();
  Loaded loaded{.collection = collection, .vocabulary = vocabulary, .at = view.Position()};
  if (vocabulary == 0) return loaded;
  const std::shared_ptr<const Vocabulary> words = view.ReadVocabulary(vocabulary);
  auto quantizer =
      std::async(std::launch::async, [&words] { return std::make_shared<const Quantizer>(words); });
  auto saved = ReadFiles(view, vocabulary, words->size());  // waits for the disk meanwhile
  loaded.quantizer = quantizer.get();
  if (saved) {
    const std::size_t images = saved->snapshot.images;
    Loaded from_files = loaded;
    from_files.index =
        std::make_shared<InvertedIndex>(loaded.quantizer, std::move(saved->snapshot));
    from_files.at = saved->at;
    from_files.saved = saved->at;
    if (BringUpToDate(from_files, view)) {
      Progress(images);
      return from_files;
    }
  }
  loaded.index = std::make_shared<InvertedIndex>(loaded.quantizer);
  view.ForEachImage(vocabulary, *loaded.quantizer, 0, InvertedIndex::kMostAtOnce,
                    [&](std::vector<IndexedImage> chunk) {
                      const std::size_t images = chunk.size();
                      loaded.index->Append(std::move(chunk));
                      Progress(images);
                    });
  loaded.took = Clock::now() - begun;
  return loaded;
}

std::optional<IndexFiles::Saved> MemoryRanker::ReadFiles(FeedView& view, Key vocabulary,
                                                         std::size_t words) const {
  if (!options_.files) return std::nullopt;
  try {
    return options_.files->Read(view, vocabulary, words);
  } catch (const Error& error) {
    if (options_.warn) {
      options_.warn(std::string(error.what()) + "; the index is built from the database again");
    }
    return std::nullopt;
  }
}

MemoryRanker::Loaded* MemoryRanker::Unsaved(std::int64_t changes) {
  for (auto& [name, entry] : entries_) {
    if (!entry.shown || !entry.is_current() || !entry.shown->index) continue;
    Loaded& shown = *entry.shown;
    const FeedPosition saved = shown.saved.value_or(FeedPosition{});
    const std::int64_t since = shown.at.image - saved.image + shown.at.removal - saved.removal;
    if (shown.saved && since < changes) continue;
    if (shown.index->snapshot()->images >= options_.save_from) return &shown;
  }
  return nullptr;
}

void MemoryRanker::Save() {
  if (!saver_.joinable()) return;
  SaveWhile([this](Lock&) { return Unsaved(1); });
}

void MemoryRanker::SaveWhile(const std::function<Loaded*(Lock& lock)>& next) {
  Lock lock(mutex_);
  while (Loaded* const unsaved = next(lock)) {
    unsaved->saved = unsaved->at;  // also if it fails: it is tried again after more changes
    const Loaded loaded = *unsaved;
    const std::shared_ptr<const IndexSnapshot> snapshot = loaded.index->snapshot();
    lock.unlock();
    try {
      options_.files->Write(*feed_, loaded.vocabulary, *snapshot, loaded.at,
                            [&](auto old, auto same) {
                              const Lock exchanging(mutex_);
                              loaded.index->Exchange(old, std::move(same));
                            });
    } catch (const std::exception& error) {
      if (options_.warn) {
        options_.warn(std::string("the index is not saved, so the next start takes longer: ") +
                      error.what());
      }
    }
    lock.lock();
  }
}

std::shared_ptr<const void> MemoryRanker::Prepare(Key collection, Key vocabulary) {
  {
    const std::lock_guard lock(mutex_);
    if (!in_use_) return nullptr;  // the first search loads it
  }
  const std::unique_ptr<FeedView> view = feed_->Poll();
  auto prepared = std::make_shared<const Loaded>(LoadAside(*view, collection, vocabulary));
  const std::lock_guard lock(mutex_);
  prepared_.push_back(prepared);
  return prepared;
}

void MemoryRanker::Progress(std::size_t images) {
  const std::lock_guard lock(progress_mutex_);
  loaded_ += images;
  if (!loading_ || to_load_ == 0) return;
  loading_(std::min(1.0, static_cast<double>(loaded_) / static_cast<double>(to_load_)));
}

std::size_t MemoryRanker::memory_bytes() const {
  const std::lock_guard lock(mutex_);
  std::size_t bytes = 0;
  for (const auto& [name, entry] : entries_) {
    for (const auto* loaded : {&entry.shown, &entry.previous}) {
      if (*loaded && (*loaded)->index) bytes += (*loaded)->index->snapshot()->memory_bytes();
    }
  }
  return bytes;
}

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
      view = feed_->Poll();  // one state for memory and database
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
    std::unordered_map<std::int64_t, std::uint64_t> digests;
    for (const IndexSnapshot::Part& part : snapshot->parts) {
      const auto of_segment = part.segment->codes().Digests(part.segment->size());
      for (std::size_t i = 0; i < of_segment.size(); ++i) {
        if (!part.IsDead(i)) digests.emplace((*part.segment)[i].key, of_segment[i]);
      }
    }
    const auto compare = [&, &in_memory = *snapshot](const std::vector<IndexedImage>& chunk) {
      stored += chunk.size();
      for (const IndexedImage& image : chunk) {
        const auto digest = digests.find(image.key);
        if (digest != digests.end() && digest->second == CodeLists::Digest(image.bow)) continue;
        const std::optional<Bow> bow = in_memory.Find(image.key);
        if (!bow || bow->words != image.bow.words || !AreAlike(bow->codes, image.bow.codes)) {
          problems.push_back("image \"" + image.id + "\": index and database differ in its words");
        }
      }
    };
    view->ForEachImage(loaded.vocabulary, *loaded.quantizer, 0, InvertedIndex::kMostAtOnce,
                       compare);
    if (stored != snapshot->images) {
      problems.push_back("collection \"" + name + "\": the index holds " +
                         std::to_string(snapshot->images) + " images, the database " +
                         std::to_string(stored));
    }
  }
  return problems;
}

}  // namespace pliant
