// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The inverted index in memory: immutable segments, merged as they grow (a log-structured merge
// tree: an image is copied about log_8 N times), tombstones for removed images, and snapshots
// that searches keep while one writer makes the next.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "index/rank/index_segment.h"

namespace pliant {

// A searchable state. Immutable; keep the shared_ptr as long as results refer to it.
struct IndexSnapshot {
  struct Part {
    std::shared_ptr<const IndexSegment> segment;
    std::shared_ptr<const std::vector<bool>> dead;  // nullptr = all alive
    std::size_t dead_count = 0;

    std::size_t alive() const { return segment->size() - dead_count; }
    bool IsDead(std::size_t image) const { return dead != nullptr && (*dead)[image]; }
  };

  std::size_t images = 0;  // alive
  std::vector<Part> parts;

  // The words of an image, if it is alive.
  std::optional<Bow> Find(std::int64_t key) const;
  std::vector<std::int64_t> Keys() const;  // of the living, ascending
  std::size_t memory_bytes() const;
};

// Changes: one thread at a time. snapshot(): any thread.
class InvertedIndex {
 public:
  // `quantizer`: of the vocabulary, which must have a codebook (kInvalidArgument
  // "codebook_malformed").
  explicit InvertedIndex(std::shared_ptr<const Quantizer> quantizer);

  std::shared_ptr<const IndexSnapshot> snapshot() const;

  // Removes keys (unknown ones are skipped), adds images with keys that are not in the index, and
  // publishes ONE new snapshot. The cost depends on the size of the change, not of the index,
  // except for occasional merges.
  void Apply(std::vector<IndexedImage> added, std::span<const std::int64_t> removed);
  // Adds images that the next Apply publishes together with its own: a change of any size is one
  // snapshot without being in memory as one list.
  void Stage(std::vector<IndexedImage> added);
  // False from Stage, or from an Apply that an exception ended, to the end of the next Apply.
  bool is_whole() const { return !is_changing_; }
  // For loading: adds without merges.
  void Append(std::vector<IndexedImage> added);

 private:
  using Part = IndexSnapshot::Part;

  void AddParts(IndexSnapshot& next, std::vector<IndexedImage> added);
  void Publish(std::shared_ptr<const IndexSnapshot> next);

  const std::shared_ptr<const Quantizer> quantizer_;
  mutable std::mutex mutex_;  // guards snapshot_
  std::shared_ptr<const IndexSnapshot> snapshot_;
  std::shared_ptr<IndexSnapshot> staged_;  // nullptr: nothing is
  bool is_changing_ = false;
};

}  // namespace pliant
