// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/clickhouse_feed.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <string>
#include <thread>
#include <utility>

#include "descriptor/base/error.h"
#include "index/store/vocabulary_rows.h"
#include "index/store/word_codec.h"

namespace pliant::clickhouse {
namespace {

Bytes BytesOf(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

// A picture that is to be loaded.
struct Wanted {
  std::uint64_t version = 0;
  std::uint32_t picture = 0;
  std::string id;
  std::string object;
};

class ClickhouseFeedView : public FeedView {
 public:
  ClickhouseFeedView(ClusterLink* link, Snapshots* snapshots, Snapshot snapshot)
      : link_(*link),
        snapshots_(*snapshots),
        answering_(link->partial() ? std::optional(link->Answering()) : std::nullopt),
        states_(link, answering_),
        snapshot_(std::move(snapshot)) {}

  FeedPosition Position() override {
    const auto log = static_cast<std::int64_t>(snapshot_.log);
    return {log, log};
  }

  std::vector<CollectionState> Collections() override {
    std::vector<CollectionState> states;
    for (const auto& [name, entry] : snapshot_.registry->collections) {
      states.push_back({entry.key, name, entry.vocabulary, entry.created_ms});
    }
    return states;
  }

  std::optional<std::vector<std::int64_t>> RemovedSince(std::int64_t removal) override {
    if (static_cast<std::uint64_t>(removal) < snapshot_.registry->purge.log) return std::nullopt;
    const NativeBlock rows =
        link_.Read(ClusterLink::kHome, "SELECT before FROM log WHERE before != 0" + After(removal),
                   {{"before", "UInt64"}});
    std::vector<std::int64_t> removed;
    for (std::size_t i = 0; i < rows.rows; ++i) removed.push_back(Row(rows, i).Signed(0));
    snapshots_.RequireKept(snapshot_);
    return removed;
  }

  std::shared_ptr<const Vocabulary> ReadVocabulary(Key vocabulary) override {
    return clickhouse::ReadVocabulary(link_, *snapshot_.registry, vocabulary);
  }

  std::uint64_t CountPictures(Key collection) override {
    return states_
        .Outlines({.collection = static_cast<std::uint32_t>(collection), .log = snapshot_.log})
        .size();
  }

  void ForEachPicture(Key vocabulary, std::size_t words, std::int64_t after, std::size_t chunk,
                      const std::function<void(std::vector<IndexedPicture>)>& work) override {
    const auto entry = snapshot_.registry->vocabularies.find(vocabulary);
    if (entry == snapshot_.registry->vocabularies.end()) return;
    const std::uint32_t collection = entry->second.collection;
    const std::vector<Wanted> wanted = after == 0 ? All(collection) : Since(collection, after);
    RequireShards(collection, wanted);
    for (std::size_t from = 0; from < wanted.size(); from += kTogether) {
      const std::size_t count = std::min(kTogether, wanted.size() - from);
      Load(vocabulary, words, std::span(wanted).subspan(from, count));
      snapshots_.RequireKept(snapshot_);
      while (loaded_.size() >= chunk) Give(chunk, work);
    }
    if (!loaded_.empty()) Give(loaded_.size(), work);
  }

 private:
  // Before anything is given away: who follows keeps what it has.
  void RequireShards(std::uint32_t collection, const std::vector<Wanted>& wanted) {
    const std::vector<std::size_t> gone = answering_ ? std::vector<std::size_t>() : link_.Gone();
    if (gone.empty()) return;
    for (const Wanted& one : wanted) {
      const std::size_t shard = link_.ShardOf(collection, one.id);
      if (std::find(gone.begin(), gone.end(), shard) == gone.end()) continue;
      throw Error(ErrorCode::kUnavailable, "shard_unavailable",
                  "shard " + std::to_string(shard + 1) + " has changes, and does not answer");
    }
  }

  static constexpr std::size_t kTogether = 256;  // pictures whose words are read by one statement

  std::string After(std::int64_t version) const {
    return " AND version > " + std::to_string(version) +
           " AND version <= " + std::to_string(snapshot_.log);
  }

  std::vector<Wanted> All(std::uint32_t collection) {
    std::vector<Wanted> wanted;
    for (PictureOutline& outline :
         states_.Outlines({.collection = collection, .log = snapshot_.log})) {
      wanted.push_back(
          {outline.version, outline.picture, std::move(outline.id), std::move(outline.object)});
    }
    return Sorted(std::move(wanted));
  }

  // The newest state of each picture that has changed, unless it is gone.
  std::vector<Wanted> Since(std::uint32_t collection, std::int64_t after) {
    const NativeBlock rows =
        link_.Read(ClusterLink::kHome,
                   "SELECT version, picture, id, object, deleted FROM log WHERE collection = " +
                       std::to_string(collection) + After(after),
                   {{"version", "UInt64"},
                    {"picture", "UInt32"},
                    {"id", "String"},
                    {"object", "String"},
                    {"deleted", "UInt8"}});
    std::map<std::string, std::size_t> newest;  // row by id
    for (std::size_t i = 0; i < rows.rows; ++i) {
      const auto [known, fresh] = newest.emplace(Row(rows, i).Text(2), i);
      if (!fresh && Row(rows, i).Number(0) > Row(rows, known->second).Number(0)) known->second = i;
    }
    std::vector<Wanted> wanted;
    for (const auto& [id, i] : newest) {
      const Row row(rows, i);
      if (row.Number(4) != 0) continue;
      wanted.push_back({row.Number(0), static_cast<std::uint32_t>(row.Number(1)), id, row.Text(3)});
    }
    return Sorted(std::move(wanted));
  }

  static std::vector<Wanted> Sorted(std::vector<Wanted> wanted) {
    std::sort(wanted.begin(), wanted.end(),
              [](const Wanted& a, const Wanted& b) { return a.version < b.version; });
    return wanted;
  }

  void Load(Key vocabulary, std::size_t words, std::span<const Wanted> wanted) {
    std::vector<std::uint64_t> numbers;
    for (const Wanted& one : wanted) numbers.push_back(one.picture);
    const auto blobs = states_.Words(vocabulary, numbers);
    for (const Wanted& one : wanted) {
      const auto blob = blobs.find(one.picture);
      if (blob == blobs.end()) continue;  // it has none of this vocabulary
      loaded_.push_back({static_cast<std::int64_t>(one.version), ObjectKey(one.object), one.id,
                         DecodeBow(blob->second, words)});
    }
  }

  void Give(std::size_t count, const std::function<void(std::vector<IndexedPicture>)>& work) {
    const auto end = loaded_.begin() + static_cast<std::ptrdiff_t>(count);
    std::vector<IndexedPicture> chunk(std::make_move_iterator(loaded_.begin()),
                                      std::make_move_iterator(end));
    loaded_.erase(loaded_.begin(), end);
    work(std::move(chunk));
  }

  ClusterLink& link_;
  Snapshots& snapshots_;
  const std::optional<std::vector<std::size_t>> answering_;  // absent: all must
  PictureStates states_;
  const Snapshot snapshot_;
  std::vector<IndexedPicture> loaded_;
};

}  // namespace

std::shared_ptr<const Vocabulary> ReadVocabulary(ClusterLink& link, const Registry& registry,
                                                 Key vocabulary) {
  const auto found = registry.vocabularies.find(vocabulary);
  if (found == registry.vocabularies.end() || !registry.model) {
    VocabularyRows::ThrowCorrupt(vocabulary, "is missing");
  }
  const VocabularyEntry& entry = found->second;
  const DescriptorInfo& model = registry.model->info;
  VocabularyRows rows({vocabulary, static_cast<std::int64_t>(entry.words), model.kind, model.dim,
                       model.model_id, entry.origin, entry.checksum});
  const NativeBlock words =
      link.Read(ClusterLink::kHome,
                "SELECT word, data, thresholds FROM vocabulary_words WHERE vocabulary = " +
                    std::to_string(vocabulary) + " ORDER BY word",
                {{"word", "UInt32"}, {"data", "String"}, {"thresholds", "String"}});
  Bytes codebook;
  for (std::size_t i = 0; i < words.rows; ++i) {
    const Row row(words, i);
    if (row.Number(0) == kCodebookWord) {
      codebook = BytesOf(row.Text(1));
    } else {
      rows.Add(row.Signed(0), BytesOf(row.Text(1)), BytesOf(row.Text(2)));
    }
  }
  return rows.Finish(codebook);
}

// Who has followed one replica stays where it is while another one, which is behind, answers:
// what that one lacks was never acknowledged.
std::int64_t ClickhouseFeed::Version() {
  const std::uint64_t now = snapshots_.Version();
  std::uint64_t told = told_;
  while (now > told && !told_.compare_exchange_weak(told, now)) {
  }
  return static_cast<std::int64_t>(std::max(now, told));
}

// Never less than was told: it would be taken for all there is.
std::unique_ptr<FeedView> ClickhouseFeed::Look() {
  constexpr int kTries = 20;
  constexpr std::chrono::milliseconds kPause{50};
  for (int i = 0; i < kTries; ++i) {
    Snapshot now = snapshots_.Now();
    std::uint64_t told = told_;
    while (now.log > told && !told_.compare_exchange_weak(told, now.log)) {
    }
    if (now.log >= told) {
      looked_ = now.log;
      return std::make_unique<ClickhouseFeedView>(&link_, &snapshots_, std::move(now));
    }
    std::this_thread::sleep_for(kPause);
  }
  told_ = looked_.load();  // whoever had it may not come back
  throw Error(ErrorCode::kUnavailable, "replica_behind",
              "the replica that answers has not got yet what another one showed; try again");
}

}  // namespace pliant::clickhouse
