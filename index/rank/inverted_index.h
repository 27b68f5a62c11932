// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The inverted index in memory: immutable segments, merged as they grow (a log-structured merge
// tree: a picture is copied about log_8 N times), tombstones for removed pictures, and snapshots
// that searches keep while one writer makes the next.
//
// Statistics (N, document frequencies) belong to an epoch: since every tf-idf norm depends on them,
// they are recomputed only when more than 1/256 of the pictures have been added or removed (with
// fewer than 256 pictures always). Refresh() recomputes them immediately; a freshly loaded index is
// exact.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "index/rank/code_lists.h"
#include "index/rank/index_segment.h"

namespace pliant {

struct IndexStatistics {
  std::uint64_t pictures = 0;            // N
  std::vector<std::uint32_t> frequency;  // df: pictures that have the word
  std::vector<float> idf;                // ln((N + 1) / max(df, 1))
};

// A searchable state. Immutable; keep the shared_ptr as long as results refer to it.
struct IndexSnapshot {
  struct Part {
    std::shared_ptr<const IndexSegment> segment;
    std::shared_ptr<const std::vector<bool>> dead;  // nullptr = all alive
    std::size_t dead_count = 0;
    // 1 / (total * |d|) of each picture, |d| = norm of its tf-idf vector in these statistics.
    std::shared_ptr<const std::vector<float>> inverse_norms;
    // 1 / sqrt of the sum of the idf of each picture's words; nullptr without signatures.
    std::shared_ptr<const std::vector<float>> inverse_alike_norms;
    std::shared_ptr<const CodeLists> codes;  // nullptr without codes

    std::size_t alive() const { return segment->size() - dead_count; }
    bool IsDead(std::size_t picture) const { return dead != nullptr && (*dead)[picture]; }
  };

  std::size_t vocabulary_size = 0;
  std::size_t pictures = 0;  // alive
  std::vector<Part> parts;
  std::shared_ptr<const IndexStatistics> statistics;

  // Whether every picture's words have signatures (there is one at least).
  bool has_signatures() const;
  bool has_codes() const;
  // The words of a picture, if it is alive.
  std::optional<Bow> Find(std::int64_t key) const;
  std::vector<std::int64_t> Keys() const;  // of the living, ascending
  std::size_t memory_bytes() const;
};

// Apply and Refresh: one thread at a time. snapshot(): any thread.
class InvertedIndex {
 public:
  // `quantizer`: of the vocabulary; pictures must have codes if it has a coder. nullptr: none have.
  explicit InvertedIndex(std::size_t vocabulary_size,
                         std::shared_ptr<const Quantizer> quantizer = nullptr);

  std::shared_ptr<const IndexSnapshot> snapshot() const;

  // Removes keys (unknown ones are skipped), adds pictures with keys that are not in the index, and
  // publishes ONE new snapshot. The cost depends on the size of the change, not of the index,
  // except for occasional merges.
  void Apply(std::vector<IndexedPicture> added, std::span<const std::int64_t> removed);
  // Adds pictures that the next Apply publishes together with its own: a change of any size is one
  // snapshot without being in memory as one list.
  void Stage(std::vector<IndexedPicture> added);
  // False from Stage, or from an Apply that an exception ended, to the end of the next Apply: what
  // is counted and what is shown differ.
  bool is_whole() const { return !is_changing_; }
  // For loading: adds without merges and statistics. Refresh() must follow before any search.
  void Append(std::vector<IndexedPicture> added);
  void Refresh();

 private:
  using Part = IndexSnapshot::Part;

  void AddParts(IndexSnapshot& next, std::vector<IndexedPicture> added);
  void Remove(IndexSnapshot& next, std::int64_t key);
  void MergeParts(IndexSnapshot& next) const;
  void RenewStatistics(IndexSnapshot& next);
  void Publish(std::shared_ptr<const IndexSnapshot> next);

  const std::size_t vocabulary_size_;
  const std::shared_ptr<const Quantizer> quantizer_;
  std::vector<std::uint32_t> frequency_;  // up to date, ahead of the epoch's
  std::uint64_t changes_ = 0;             // since the epoch's statistics
  mutable std::mutex mutex_;              // guards snapshot_
  std::shared_ptr<const IndexSnapshot> snapshot_;
  std::shared_ptr<IndexSnapshot> staged_;  // nullptr: nothing is
  bool is_changing_ = false;
};

}  // namespace pliant
