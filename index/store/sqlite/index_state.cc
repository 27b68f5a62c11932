// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/index_state.h"

#include <algorithm>
#include <utility>

#include "descriptor/base/error.h"
#include "index/store/blob_codec.h"
#include "index/store/sqlite/catalogue_vocabularies.h"

namespace pliant {
namespace {

constexpr const char* kLastKey =
    "SELECT coalesce((SELECT seq FROM sqlite_sequence WHERE name = ?), 0)";

std::int64_t LastKey(Connection& db, const char* table) {
  return db.Prepare(kLastKey).Bind(std::string(table)).One().Int(0);
}

}  // namespace

void IndexState::CatchUp() {
  const std::lock_guard lock(update_mutex_);
  CatchUpLocked();
}

void IndexState::CatchUpIfLoaded() {
  const std::lock_guard lock(update_mutex_);
  if (!reload_) CatchUpLocked();
}

void IndexState::CatchUpLocked() {
  const std::int64_t version = watch_->Scalar("PRAGMA data_version");
  if (version == data_version_) return;
  const SQLite::Transaction reading(watch_->database());  // one consistent view of all tables
  Follow();
  data_version_ = version;
}

void IndexState::Follow() {
  // Until the end is reached without an exception, memory is of no known state.
  const bool reload = std::exchange(reload_, true);
  data_version_ = -1;
  const Key newest_picture = LastKey(*watch_, "pictures");
  const std::int64_t newest_removal = LastKey(*watch_, "removals");
  std::vector<std::int64_t> removed;
  Cursor removals = watch_->Prepare("SELECT seq, picture FROM removals WHERE seq > ? ORDER BY seq");
  removals.Bind(last_removal_);
  std::int64_t first_removal = newest_removal + 1;
  while (removals.Next()) {
    first_removal = std::min(first_removal, removals.Int(0));
    removed.push_back(removals.Int(1));
  }
  // Old removals are dropped in time: after a gap only a reload tells what is gone.
  const bool gap = reload || (newest_removal > last_removal_ && first_removal != last_removal_ + 1);

  std::int64_t loaded = 0;  // of the first load, for loading_
  const std::int64_t to_load =
      loading_ ? watch_->Scalar(
                     "SELECT count(*) FROM pictures p JOIN collections c "
                     "ON c.key = p.collection WHERE c.active_vocabulary IS NOT NULL")
               : 0;
  const auto progress = [&](std::size_t pictures) {
    loaded += static_cast<std::int64_t>(pictures);
    if (loading_ && to_load > 0) {
      loading_(std::min(1.0, static_cast<double>(loaded) / static_cast<double>(to_load)));
    }
  };
  Collections next;
  for (const CollectionRow& row : AllCollections(*watch_)) {
    const auto known = collections_->find(row.name);
    if (gap || known == collections_->end() || known->second.key != row.key ||
        known->second.vocabulary != row.active_vocabulary) {
      next.emplace(row.name, Load(row, progress));
      continue;
    }
    const Collection& collection = known->second;
    if (collection.index) {
      collection.index->Apply({}, removed);
      ForEachChunk(row.active_vocabulary, collection.quantizer->vocabulary().size(), last_picture_,
                   [&](std::vector<IndexedPicture> chunk) {
                     collection.index->Apply(std::move(chunk), {});
                   });
    }
    next.emplace(row.name, collection);
  }
  last_picture_ = newest_picture;
  last_removal_ = newest_removal;
  reload_ = false;
  loading_ = nullptr;
  const std::lock_guard lock(collections_mutex_);
  collections_ = std::make_shared<const Collections>(std::move(next));
}

IndexState::Collection IndexState::Load(const CollectionRow& row,
                                        const std::function<void(std::size_t)>& progress) {
  Collection collection{row.key, row.active_vocabulary, nullptr, nullptr};
  if (row.active_vocabulary == 0) return collection;
  collection.quantizer =
      std::make_shared<const Quantizer>(ReadVocabulary(*watch_, row.active_vocabulary));
  const std::size_t words = collection.quantizer->vocabulary().size();
  collection.index = std::make_shared<InvertedIndex>(words);
  ForEachChunk(row.active_vocabulary, words, 0, [&](std::vector<IndexedPicture> chunk) {
    const std::size_t pictures = chunk.size();
    collection.index->Append(std::move(chunk));
    progress(pictures);
  });
  collection.index->Refresh();
  return collection;
}

void IndexState::ForEachChunk(Key vocabulary, std::size_t words, Key after,
                              const std::function<void(std::vector<IndexedPicture>)>& work) {
  Cursor row = watch_->Prepare(
      "SELECT p.key, p.object, p.id, w.data FROM picture_words w JOIN pictures p ON p.key = "
      "w.picture "
      "WHERE w.vocabulary = ? AND w.picture > ? ORDER BY w.picture");
  row.Bind(vocabulary, after);
  std::vector<IndexedPicture> chunk;
  while (row.Next()) {
    chunk.push_back(
        {row.Int(0), row.IsNull(1) ? 0 : row.Int(1), row.Text(2), DecodeBow(row.Blob(3), words)});
    if (chunk.size() == IndexSegment::kMaxPictures) work(std::exchange(chunk, {}));
  }
  if (!chunk.empty()) work(std::move(chunk));
}

CollectionView IndexState::Find(const std::string& collection) const {
  std::shared_ptr<const Collections> collections;
  {
    const std::lock_guard lock(collections_mutex_);
    collections = collections_;
  }
  const auto found = collections->find(collection);
  if (found == collections->end()) {
    throw Error(ErrorCode::kNotFound, "collection_not_found",
                "there is no collection \"" + collection + "\"");
  }
  const Collection& state = found->second;
  return {state.key, state.vocabulary, state.quantizer,
          state.index ? state.index->snapshot() : nullptr};
}

std::size_t IndexState::memory_bytes() const {
  std::shared_ptr<const Collections> collections;
  {
    const std::lock_guard lock(collections_mutex_);
    collections = collections_;
  }
  std::size_t bytes = 0;
  for (const auto& [name, collection] : *collections) {
    if (collection.index) bytes += collection.index->snapshot()->memory_bytes();
  }
  return bytes;
}

std::vector<std::string> IndexState::Compare() {
  const std::lock_guard lock(update_mutex_);
  const SQLite::Transaction reading(watch_->database());
  Follow();
  std::vector<std::string> problems;
  for (const auto& [name, collection] : *collections_) {
    if (!collection.index) continue;
    const std::shared_ptr<const IndexSnapshot> snapshot = collection.index->snapshot();
    std::size_t stored = 0;
    const auto compare = [&](const std::vector<IndexedPicture>& chunk) {
      stored += chunk.size();
      for (const IndexedPicture& picture : chunk) {
        const std::optional<Bow> bow = snapshot->Find(picture.key);
        if (!bow || bow->words != picture.bow.words) {
          problems.push_back("picture \"" + picture.id +
                             "\": index and database differ in its words");
        }
      }
    };
    ForEachChunk(collection.vocabulary, collection.quantizer->vocabulary().size(), 0, compare);
    if (stored != snapshot->pictures) {
      problems.push_back("collection \"" + name + "\": the index holds " +
                         std::to_string(snapshot->pictures) + " pictures, the database " +
                         std::to_string(stored));
    }
  }
  return problems;
}

}  // namespace pliant
