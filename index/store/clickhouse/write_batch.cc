// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/write_batch.h"

#include <algorithm>
#include <functional>
#include <future>

#include "descriptor/base/hex.h"
#include "index/store/vocabulary_rows.h"
#include "index/store/word_codec.h"

namespace pliant::clickhouse {
namespace {

constexpr std::uint64_t kRowsABlock = 2000;  // of words and pictures

std::string_view TextOf(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string RawHash(const std::string& hex) {
  const auto bytes = FromHex(hex).value_or(std::vector<std::uint8_t>{});
  return {bytes.begin(), bytes.end()};
}

template <typename T>
void Append(std::vector<T>& to, std::vector<T>& from) {
  to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

bool HasCommon(const Changes& changes) {
  return std::any_of(changes.registry.begin(), changes.registry.end(), IsCommon);
}

// Writes rows of a table, so many at a time.
class Rows {
 public:
  Rows(ClusterLink* link, std::size_t shard, const char* table)
      : link_(*link), shard_(shard), table_(Table(table)), rows_(table_.columns) {}

  template <typename... Values>
  void Add(const Values&... values) {
    rows_.Add(values...);
    Full();
  }
  void Add(const PictureState& state) {
    AddRow(rows_, state);
    Full();
  }
  void Write() {
    link_.Insert(shard_, table_, rows_.block());
    rows_ = RowWriter(table_.columns);
  }

 private:
  void Full() {
    if (rows_.block().rows >= kRowsABlock) Write();
  }

  ClusterLink& link_;
  std::size_t shard_;
  const TableSpec& table_;
  RowWriter rows_;
};

}  // namespace

Change::Change(WriteBatch* batch)
    : batch_(*batch), registry_(std::make_shared<Registry>(*batch->registry_)) {}

const Snapshot& Change::snapshot() const { return batch_.snapshot_; }

std::optional<PictureState> Change::Find(std::uint32_t collection, const std::string& id) {
  const PictureName name(collection, id);
  for (const Changes* changes : {&changes_, &batch_.changes_}) {
    if (const auto found = changes->states.find(name); found != changes->states.end()) {
      if (found->second.deleted) return std::nullopt;
      return found->second;
    }
  }
  const auto known = batch_.known_.find(name);
  if (known != batch_.known_.end()) return known->second;
  return batch_.known_.emplace(name, batch_.states_.ById(collection, id, batch_.snapshot_.log))
      .first->second;
}

std::vector<PictureState> Change::FindBySha256(std::uint32_t collection,
                                               const std::string& sha256) {
  auto known = batch_.known_sha256_.find(sha256);
  if (known == batch_.known_sha256_.end()) {
    batch_.Foresee({{}, {sha256}});
    known = batch_.known_sha256_.find(sha256);
  }
  std::map<std::string, PictureState> found;  // by id
  const auto consider = [&](const PictureName& name) {
    if (name.first != collection) return;
    auto state = Find(name.first, name.second);
    if (state && state->record.sha256 == sha256) found.emplace(name.second, *std::move(state));
  };
  for (const PictureName& name : known->second) consider(name);
  for (const Changes* changes : {&changes_, &batch_.changes_}) {
    for (const auto& [name, state] : changes->states) {
      if (state.record.sha256 == sha256) consider(name);
    }
  }
  std::vector<PictureState> states;
  for (auto& [id, state] : found) states.push_back(std::move(state));
  return states;
}

std::uint32_t Change::NewPicture() { return batch_.numbers_.picture(); }
Key Change::NewKey() { return batch_.numbers_.key(); }

void Change::Put(PictureState state, const std::optional<PictureState>& now) {
  state.version = batch_.next_version_++;
  changes_.commits.push_back({now ? now->version : 0, state});
  PictureName name(state.collection, state.record.id);
  changes_.states.insert_or_assign(std::move(name), std::move(state));
}

void Change::Remove(const PictureState& now) {
  PictureState state;
  state.collection = now.collection;
  state.picture = now.picture;
  state.deleted = true;
  state.record.id = now.record.id;
  state.record.sha256 = now.record.sha256;
  Put(std::move(state), now);
}

void Change::AddWords(std::uint32_t collection, const std::string& id, Key vocabulary,
                      std::uint32_t picture, std::vector<std::uint8_t> encoded) {
  changes_.words.push_back(
      {batch_.link_.ShardOf(collection, id), vocabulary, picture, std::move(encoded)});
}

void Change::AddFeatures(std::uint32_t collection, const std::string& id, std::uint32_t picture,
                         std::vector<std::uint8_t> encoded) {
  changes_.features.push_back(
      {batch_.link_.ShardOf(collection, id), picture, {}, std::move(encoded)});
}

void Change::AddOriginal(std::uint32_t collection, const std::string& id, const std::string& sha256,
                         Bytes bytes) {
  changes_.originals.push_back(
      {batch_.link_.ShardOf(collection, id), 0, sha256, {bytes.begin(), bytes.end()}});
}

void Change::AddVocabularyWords(Key vocabulary, const Vocabulary& words) {
  changes_.vocabularies.emplace_back(vocabulary, words);
}

void Change::Set(RegistryRow row) {
  Apply(row, *registry_);
  changes_.registry.push_back(std::move(row));
}

WriteBatch::WriteBatch(ClusterLink* link, Snapshot snapshot, Numbers numbers,
                       std::uint64_t first_version)
    : link_(*link),
      states_(link),
      snapshot_(std::move(snapshot)),
      numbers_(std::move(numbers)),
      next_version_(first_version),
      registry_(snapshot_.registry) {}

void WriteBatch::Foresee(const Foreseen& foreseen) {
  std::vector<PictureName> names;
  for (const auto& [collection, id] : foreseen.pictures) {
    const CollectionEntry* entry = registry_->Find(collection);
    if (entry != nullptr && known_.count({entry->key, id}) == 0) names.emplace_back(entry->key, id);
  }
  for (const PictureName& name : names) known_[name] = std::nullopt;
  const auto learn = [this](PictureState state) {
    PictureName name(state.collection, state.record.id);
    known_[std::move(name)] = std::move(state);
  };
  for (PictureState& state : states_.ByRefs(names, snapshot_.log)) learn(std::move(state));
  for (const std::string& sha256 : foreseen.sha256) known_sha256_[sha256];
  for (PictureState& state : states_.BySha256(foreseen.sha256, snapshot_.log)) {
    known_sha256_[state.record.sha256].emplace_back(state.collection, state.record.id);
    learn(std::move(state));
  }
}

void WriteBatch::Run(const std::function<void(Change& change)>& work) {
  Change change(this);
  work(change);
  Changes& done = change.changes_;
  for (auto& [name, state] : done.states) changes_.states.insert_or_assign(name, std::move(state));
  Append(changes_.commits, done.commits);
  Append(changes_.words, done.words);
  Append(changes_.features, done.features);
  Append(changes_.originals, done.originals);
  Append(changes_.registry, done.registry);
  Append(changes_.vocabularies, done.vocabularies);
  registry_ = std::move(change.registry_);
}

bool WriteBatch::empty() const {
  return changes_.commits.empty() && changes_.words.empty() && changes_.features.empty() &&
         changes_.originals.empty() && changes_.registry.empty() && changes_.vocabularies.empty();
}

bool WriteBatch::HasCommit() const { return !changes_.commits.empty() || HasCommon(changes_); }

// Each insert waits for its quorum, so those that do not depend on each other go at the same time.
void WriteBatch::WriteShard(std::size_t shard) {
  // Lives longer than `tables`, whose inserts use it, also when one of them throws.
  const auto each_state = [&](const std::function<void(const PictureState& state)>& work) {
    for (const NewCommit& commit : changes_.commits) {
      const PictureState& state = commit.state;
      if (link_.ShardOf(state.collection, state.record.id) == shard) work(state);
    }
  };
  std::vector<std::future<void>> tables;
  const auto write = [&](const char* table, const std::function<void(Rows & rows)>& fill) {
    tables.push_back(std::async(std::launch::async, [this, shard, table, fill] {
      Rows rows(&link_, shard, table);
      fill(rows);
      rows.Write();
    }));
  };
  write("words", [&](Rows& rows) {
    for (const NewWords& one : changes_.words) {
      if (one.shard == shard) rows.Add(one.vocabulary, one.picture, TextOf(one.encoded));
    }
  });
  write("features", [&](Rows& rows) {
    for (const NewBlob& one : changes_.features) {
      if (one.shard == shard) rows.Add(one.picture, TextOf(one.bytes));
    }
  });
  write("originals", [&](Rows& rows) {
    for (const NewBlob& one : changes_.originals) {
      if (one.shard == shard) rows.Add(RawHash(one.sha256), TextOf(one.bytes));
    }
  });
  write("by_sha256", [&](Rows& rows) {
    each_state([&](const PictureState& state) {
      if (state.deleted) return;
      rows.Add(RawHash(state.record.sha256), state.collection, state.record.id);
    });
  });
  write("by_object", [&](Rows& rows) {
    each_state([&](const PictureState& state) {
      if (state.deleted || state.record.object.empty()) return;
      rows.Add(state.collection, state.record.object, state.record.id);
    });
  });
  for (auto& table : tables) table.get();
  // Last: who finds these without a commit commits them (ClusterCommits::Recover).
  Rows pictures(&link_, shard, "pictures");
  each_state([&](const PictureState& state) { pictures.Add(state); });
  pictures.Write();
}

void WriteBatch::WriteVocabularies() {
  for (const auto& [key, vocabulary] : changes_.vocabularies) {
    Rows rows(&link_, ClusterLink::kHome, "vocabulary_words");
    for (std::size_t i = 0; i < vocabulary.size(); ++i) {
      rows.Add(key, i, TextOf(WordBytes(vocabulary.words, i)),
               TextOf(ThresholdBytes(vocabulary, i)));
    }
    if (!vocabulary.codebook.empty()) {
      const std::vector<std::uint8_t> codebook = EncodeCodebook(vocabulary.codebook);
      rows.Add(key, kCodebookWord, TextOf(codebook), std::string_view());
    }
    rows.Write();
  }
}

void WriteBatch::WriteRows() {
  std::vector<std::future<void>> others;
  const std::size_t shards = link_.shards();
  for (std::size_t shard = 1; shard < shards; ++shard) {
    others.push_back(std::async(std::launch::async, [this, shard] { WriteShard(shard); }));
  }
  WriteShard(0);
  for (auto& other : others) other.get();
  WriteVocabularies();
}

void WriteBatch::WriteLog() {
  if (!changes_.registry.empty()) {
    Rows rows(&link_, ClusterLink::kHome, "registry");
    for (const RegistryRow& row : changes_.registry) {
      rows.Add(row.kind, row.name, next_version_++, row.deleted ? 1 : 0, row.body);
    }
    rows.Write();
  }
  if (HasCommit()) WriteLogRows(link_, changes_.commits, HasCommon(changes_) ? next_version_++ : 0);
}

void WriteLogRows(ClusterLink& link, const std::vector<NewCommit>& commits, std::uint64_t common) {
  RowWriter rows(Table("log").columns);  // one block: one commit
  for (const NewCommit& commit : commits) {
    const PictureState& state = commit.state;
    rows.Add(state.version, commit.before, state.collection, state.record.id, state.deleted ? 1 : 0,
             state.picture, state.record.object);
  }
  if (common != 0) rows.Add(common, 0, 0, std::string_view(), 0, 0, std::string_view());
  link.Insert(ClusterLink::kHome, Table("log"), rows.block());
}

}  // namespace pliant::clickhouse
