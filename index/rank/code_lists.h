// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The codes of a segment's descriptors (vocab/residual_codes.h), word by word. Ranking by nearest
// neighbours scans them, and histograms count them. Private to index/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "index/rank/array.h"
#include "index/records/image_ref.h"
#include "vocab/code_scan.h"
#include "vocab/residual_codes.h"

namespace pliant {

// Immutable. Within a word codes come in order of the image.
class CodeLists {
 public:
  using ImageNumber = std::uint16_t;  // in the segment
  static constexpr std::size_t kMaxImages = 65536;
  static constexpr std::uint32_t kGone = std::numeric_limits<std::uint32_t>::max();

  // images[p], at most kMaxImages, is at position p. Each must have a code for each of its
  // descriptors (Bow::codes); throws kCorrupt "codes_missing" otherwise, kInternal
  // "segment_too_large" for 2^32 codes.
  static CodeLists Build(std::span<const IndexedImage> images, std::size_t vocabulary_size,
                         const ResidualCoder& coder);
  struct Source {
    const CodeLists* lists = nullptr;
    const std::vector<std::uint32_t>* position = nullptr;  // in the result, by image; or kGone
  };
  static CodeLists Merge(std::span<const Source> sources);

  std::size_t vocabulary_size() const { return offsets_.size() - 1; }
  CodeList List(std::uint32_t word) const;
  // The number of the list's first code among all codes.
  std::size_t First(std::uint32_t word) const { return offsets_[word]; }
  // Of the list's codes; ascending.
  std::span<const ImageNumber> Images(std::uint32_t word) const {
    return images_.span().subspan(offsets_[word], offsets_[word + 1] - offsets_[word]);
  }
  // Calls `visit` for each image with the word, ascending, and its number of occurrences.
  template <typename Visit>  // void(std::size_t image, std::size_t count)
  void ForEachCount(std::uint32_t word, Visit&& visit) const {
    const auto images = Images(word);
    for (std::size_t first = 0; first < images.size();) {
      std::size_t end = first + 1;
      while (end < images.size() && images[end] == images[first]) ++end;
      visit(std::size_t{images[first]}, end - first);
      first = end;
    }
  }
  // The words of an image with their codes, but without biases. Looks into all lists.
  Bow BowOf(std::size_t image) const;
  // Of the words and codes of each image; `images`: their number. Equal ones have the same digest.
  std::vector<std::uint64_t> Digests(std::size_t images) const;
  static std::uint64_t Digest(const Bow& bow);
  std::size_t memory_bytes() const;

 private:
  friend class SegmentFile;
  struct Parts;

  std::size_t bytes_ = 0;  // per code
  bool binary_ = false;
  Array<std::uint32_t> offsets_;  // codes of word w: [offsets_[w], offsets_[w + 1])
  Array<ImageNumber> images_;     // of each code
  Array<std::int16_t> biases_;    // empty for binary descriptors
  Array<std::uint8_t> codes_;     // in the layout of CodeList, and kCodePadding bytes
};

}  // namespace pliant
