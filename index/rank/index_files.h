// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The index of a database in files of one folder, so that a start need not build it. Derived data:
// what is missing, damaged or of another state of the database is built again. Private to index/.
//
// VOCABULARY.json, of each vocabulary that is saved, names the position of the feed at which it was
// saved, its segments' files, and the signature that ChangeFeed::SignSaved wrote. It is written
// last. A lock on the folder keeps processes from saving at the same time; those that read map the
// files, and keep them when they are removed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "index/rank/inverted_index.h"
#include "index/store/change_feed.h"

namespace pliant {

class IndexFiles {
 public:
  // The folder need not exist. `reserve_bytes` of its disk are left free.
  IndexFiles(std::filesystem::path folder, std::uint64_t reserve_bytes)
      : folder_(std::move(folder)), reserve_bytes_(reserve_bytes) {}

  struct Saved {
    IndexSnapshot snapshot;
    FeedPosition at;
  };
  // Absent: nothing is saved that belongs to this state of the store. Throws kCorrupt and kNotFound
  // for files that are damaged or missing, kInternal "io_error".
  std::optional<Saved> Read(FeedView& view, Key vocabulary, std::size_t words) const;

  // Saves a snapshot taken at a position of the feed. Calls `exchange` for segments that have
  // become files. Throws what ThrowErrno throws, kNoSpace "no_space", kReadOnly "read_only".
  using Exchange = std::function<void(std::span<const std::shared_ptr<const IndexSegment>> old,
                                      std::shared_ptr<const IndexSegment> same)>;
  void Write(ChangeFeed& feed, Key vocabulary, const IndexSnapshot& snapshot,
             const FeedPosition& at, const Exchange& exchange);

 private:
  std::filesystem::path ManifestOf(Key vocabulary) const;
  void RemoveUnused(ChangeFeed& feed) const;

  const std::filesystem::path folder_;
  const std::uint64_t reserve_bytes_;
};

}  // namespace pliant
