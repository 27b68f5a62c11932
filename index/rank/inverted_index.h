// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The inverted index in memory: immutable segments, merged as they grow (a log-structured merge
// tree: an image is copied about log_8 N times), tombstones for removed images, and snapshots that
// searches use while one writer makes the next. Private to index/.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "index/rank/array.h"
#include "index/rank/code_lists.h"
#include "index/records/image_ref.h"

namespace pliant {

// An immutable piece of the index: up to kMaxImages images, and the codes of their descriptors by
// word.
class IndexSegment {
 public:
  static constexpr std::size_t kMaxImages = CodeLists::kMaxImages;

  struct Image {
    std::int64_t key = 0;
    std::int64_t object = 0;
    double sum_of_squares = 0;  // of the counts of its words
    std::uint32_t keypoints = 0;
    std::uint32_t id_end = 0;  // of its id in the text of all ids
  };

  // `images`: at most kMaxImages, keys ascending; words below `vocabulary_size`, and a code for
  // each descriptor (CodeLists::Build).
  static std::shared_ptr<const IndexSegment> Build(std::span<const IndexedImage> images,
                                                   std::size_t vocabulary_size,
                                                   const ResidualCoder& coder);
  struct Source {
    const IndexSegment* segment;
    const std::vector<bool>* dead;  // nullptr = none
  };
  // The living images of all sources, keys ascending.
  static std::shared_ptr<const IndexSegment> Merge(std::span<const Source> sources);

  std::size_t size() const { return images_.size(); }
  const Image& operator[](std::size_t image) const { return images_[image]; }
  std::string_view id(std::size_t image) const {
    const std::size_t begin = image == 0 ? 0 : images_[image - 1].id_end;
    return {ids_.data() + begin, images_[image].id_end - begin};
  }
  const CodeLists& codes() const { return codes_; }

  // The file that it is mapped from (segment_file.h); empty: it is in memory only.
  const std::filesystem::path& file() const { return file_; }

  std::size_t Find(std::int64_t key) const;  // position of a key, or size()
  std::size_t memory_bytes() const;

 private:
  friend class SegmentFile;
  class Builder;

  Array<Image> images_;  // by key
  Array<char> ids_;
  CodeLists codes_;
  std::filesystem::path file_;
};

// A searchable state. Immutable; keep the shared_ptr as long as results refer to it.
struct IndexSnapshot {
  struct Part {
    std::shared_ptr<const IndexSegment> segment;
    std::shared_ptr<const std::vector<bool>> dead;  // nullptr = all alive
    std::size_t dead_count = 0;

    // Of the living images of all parts.
    static Part Merged(std::span<const Part> parts);

    std::size_t alive() const { return segment->size() - dead_count; }
    bool IsDead(std::size_t image) const { return dead != nullptr && (*dead)[image]; }
  };

  std::size_t images = 0;  // alive
  std::vector<Part> parts;

  // The words of an image, if it is alive.
  std::optional<Bow> Find(std::int64_t key) const;
  std::size_t memory_bytes() const;
};

// Changes: one thread at a time. snapshot(): any thread.
class InvertedIndex {
 public:
  // Images that one change merges, or builds a segment of: it waits for no more. Larger segments,
  // of which a search has fewer to look into, come from IndexFiles.
  static constexpr std::size_t kMostAtOnce = 16'384;

  // `quantizer`: of the vocabulary, which must have a codebook (kInvalidArgument
  // "codebook_malformed").
  // `snapshot`: what it begins with; of the same vocabulary.
  explicit InvertedIndex(std::shared_ptr<const Quantizer> quantizer, IndexSnapshot snapshot = {});

  std::shared_ptr<const IndexSnapshot> snapshot() const;

  // Removes keys (unknown ones are skipped), adds images with keys that are not in the index, and
  // publishes ONE new snapshot. The cost depends on the size of the change, not of the index,
  // except for occasional merges.
  void Apply(std::vector<IndexedImage> added, std::span<const std::int64_t> removed);
  // Adds images that the next Apply publishes with its own. So a change of any size is one
  // snapshot, without one list of it in memory.
  void Stage(std::vector<IndexedImage> added);
  // False from Stage, or from an Apply that an exception ended, to the end of the next Apply.
  bool is_whole() const { return !is_changing_; }
  // For loading: adds without merges.
  void Append(std::vector<IndexedImage> added);
  // Exchanges the segments `old` for `same`, which has the images that lived in them when a
  // snapshot was taken. Does nothing if one of them is gone.
  void Exchange(std::span<const std::shared_ptr<const IndexSegment>> old,
                std::shared_ptr<const IndexSegment> same);

 private:
  using Part = IndexSnapshot::Part;

  void AddParts(IndexSnapshot& next, std::vector<IndexedImage> added);
  void Publish(std::shared_ptr<const IndexSnapshot> next);

  const std::shared_ptr<const Quantizer> quantizer_;
  mutable std::mutex mutex_;  // guards snapshot_
  std::shared_ptr<const IndexSnapshot> snapshot_;
  std::shared_ptr<IndexSnapshot> staged_;  // nullptr: nothing is staged
  bool is_changing_ = false;
};

}  // namespace pliant
