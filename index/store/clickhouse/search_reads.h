// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a search reads of a cluster: of all of it, or of the shards that answer. Private to
// store/clickhouse.
#pragma once

#include <cstdint>
#include <limits>
#include <mutex>
#include <vector>

#include "index/store/catalogue.h"
#include "index/store/clickhouse/picture_states.h"
#include "index/store/clickhouse/snapshot.h"

namespace pliant::clickhouse {

// Which states of pictures count.
struct ReadAt {
  static constexpr std::uint64_t kNewest = std::numeric_limits<std::uint64_t>::max();

  std::uint64_t log = 0;        // the newest of each picture up to here,
  std::uint64_t committed = 0;  // where it is not newer than this
};

std::vector<std::optional<StoredPicture>> LoadPicturesAt(PictureStates& states,
                                                         const Registry& registry, ReadAt at,
                                                         std::span<const PictureRef> refs,
                                                         Load what);
Admission AdmitAt(PictureStates& states, ReadAt at, std::uint32_t collection,
                  const std::optional<std::string>& object, const Filter& filter,
                  const std::vector<std::string>& without);

// The pictures that can be read while shards are gone: one statement each time that changes.
// Thread-safe.
class ReadablePictures {
 public:
  using Versions = std::shared_ptr<const std::vector<std::int64_t>>;  // ascending

  Versions Of(ClusterLink& link, const std::vector<std::size_t>& answering,
              std::uint32_t collection, ReadAt at);

 private:
  struct Entry {
    std::vector<std::size_t> answering;
    ReadAt at;
    Versions versions;
  };
  std::mutex mutex_;                        // guards the rest
  std::map<std::uint32_t, Entry> entries_;  // by collection
};

// Without the shards that are gone. Where the first of them is, which has the log of commits and
// what is common to all, the state of the store is the last one that this process has seen, and a
// picture is left out where anything newer is written of it: whether that is committed, a removal
// for example, nobody can say.
class ShardsThatAnswer : public PartialSource {
 public:
  // `now`: the snapshot, or the last known one where the first shard is gone.
  ShardsThatAnswer(ClusterLink* link, ReadablePictures* readable, Snapshot now,
                   std::vector<std::size_t> gone);

  CollectionState RequireCollection(const std::string& name) override;
  std::vector<std::optional<StoredPicture>> LoadPictures(std::span<const PictureRef> refs,
                                                         Load what) override;
  Admission Admit(Key collection, const std::optional<std::string>& object, const Filter& filter,
                  const std::vector<std::string>& without) override;
  bool follows() const override { return follows_; }
  Coverage Cover(Key collection) override;

 private:
  bool IsGone(std::uint32_t collection, const std::string& id);

  ClusterLink& link_;
  ReadablePictures& readable_;
  const Snapshot now_;
  const std::vector<std::size_t> gone_;
  const std::vector<std::size_t> answering_;
  const bool follows_;
  const ReadAt at_;
  PictureStates states_;
};

}  // namespace pliant::clickhouse
