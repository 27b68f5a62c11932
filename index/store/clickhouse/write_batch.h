// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Changes that become one commit. Each change sees those before it, and has an effect as a whole or
// not at all. Not thread-safe. Private to store/clickhouse.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "index/store/clickhouse/clickhouse_catalogue.h"
#include "index/store/clickhouse/picture_states.h"
#include "index/store/clickhouse/snapshot.h"

namespace pliant::clickhouse {

using PictureName = std::pair<std::uint32_t, std::string>;  // collection and id

// What is asked for together, before the changes are made one after the other.
struct Foreseen {
  std::vector<std::pair<std::string, std::string>> pictures;  // names of collections, and ids
  std::vector<std::string> sha256;
};

struct NewWords {
  std::size_t shard = 0;
  Key vocabulary = 0;
  std::uint32_t picture = 0;
  std::vector<std::uint8_t> encoded;
};

struct NewBlob {  // features of a picture's number, or the uploaded bytes of a SHA-256
  std::size_t shard = 0;
  std::uint32_t picture = 0;
  std::string sha256;
  std::vector<std::uint8_t> bytes;
};

struct NewCommit {  // a row of the log
  std::uint64_t before = 0;
  PictureState state;
};

// All that is to be written.
struct Changes {
  std::map<PictureName, PictureState> states;  // the newest, those that are gone too
  std::vector<NewCommit> commits;
  std::vector<NewWords> words;
  std::vector<NewBlob> features;
  std::vector<NewBlob> originals;
  std::vector<RegistryRow> registry;
  std::vector<std::pair<Key, Vocabulary>> vocabularies;  // their words
};

class WriteBatch;

// One change on its way. What it has done so far is forgotten unless it is kept.
class Change {
 public:
  explicit Change(WriteBatch* batch);

  const Registry& registry() const { return *registry_; }
  // As of before the batch: without what the batch has changed.
  const Snapshot& snapshot() const;
  // That are there now.
  std::optional<PictureState> Find(std::uint32_t collection, const std::string& id);
  std::vector<PictureState> FindBySha256(std::uint32_t collection, const std::string& sha256);

  std::uint32_t NewPicture();  // a number that nobody has had
  Key NewKey();                // of a collection or vocabulary
  // The picture is in this state from now on; its version is set. `now`: what Find gave.
  void Put(PictureState state, const std::optional<PictureState>& now);
  void Remove(const PictureState& now);
  void AddWords(std::uint32_t collection, const std::string& id, Key vocabulary,
                std::uint32_t picture, std::vector<std::uint8_t> encoded);
  void AddFeatures(std::uint32_t collection, const std::string& id, std::uint32_t picture,
                   std::vector<std::uint8_t> encoded);
  void AddOriginal(std::uint32_t collection, const std::string& id, const std::string& sha256,
                   Bytes bytes);
  void AddVocabularyWords(Key vocabulary, const Vocabulary& words);
  void Set(RegistryRow row);

 private:
  friend class WriteBatch;

  WriteBatch& batch_;
  std::shared_ptr<Registry> registry_;
  Changes changes_;
};

// Where numbers come from.
struct Numbers {
  std::function<std::uint32_t()> picture;
  std::function<Key()> key;
};

class WriteBatch {
 public:
  // Versions from `first_version` on are the batch's.
  WriteBatch(ClusterLink* link, Snapshot snapshot, Numbers numbers, std::uint64_t first_version);

  void Foresee(const Foreseen& foreseen);
  // Throws what `work` throws, and then nothing of it is kept.
  void Run(const std::function<void(Change& change)>& work);

  bool empty() const;
  // Whether it has a commit of the log: of pictures, or of what is common to all.
  bool HasCommit() const;
  // Writes all but the log: what nobody sees yet.
  void WriteRows();
  // The commit.
  void WriteLog();

 private:
  friend class Change;

  void WriteShard(std::size_t shard);
  void WriteVocabularies();

  ClusterLink& link_;
  PictureStates states_;
  const Snapshot snapshot_;
  Numbers numbers_;
  std::uint64_t next_version_;
  std::shared_ptr<const Registry> registry_;
  Changes changes_;
  std::map<PictureName, std::optional<PictureState>> known_;  // of the snapshot
  std::map<std::string, std::vector<PictureName>> known_sha256_;
};

// A commit of pictures, and of changes of the registry where `common` is not 0.
void WriteLogRows(ClusterLink& link, const std::vector<NewCommit>& commits, std::uint64_t common);

}  // namespace pliant::clickhouse
