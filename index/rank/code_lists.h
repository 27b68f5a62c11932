// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The codes of a segment's descriptors (vocab/residual_codes.h), word by word. Ranking by nearest
// neighbours scans them, and histograms count them. Private to index/.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "index/records/image_ref.h"
#include "vocab/code_scan.h"
#include "vocab/residual_codes.h"

namespace pliant {

// Immutable. Within a word codes come in order of the image. Images form pages of 256, so that a
// code's image takes one byte.
class CodeLists {
 public:
  static constexpr std::uint32_t kGone = std::numeric_limits<std::uint32_t>::max();

  // images[p] is at position p. Each must have a code for each of its descriptors (Bow::codes);
  // throws kCorrupt "codes_missing" otherwise, kInternal "segment_too_large" for 2^32 codes.
  static CodeLists Build(std::span<const IndexedImage> images, std::size_t vocabulary_size,
                         const ResidualCoder& coder);
  struct Source {
    const CodeLists* lists = nullptr;
    const std::vector<std::uint32_t>* position = nullptr;  // in the result, by image; or kGone
  };
  static CodeLists Merge(std::span<const Source> sources);

  std::size_t vocabulary_size() const { return (offsets_.size() - 1) / pages_; }
  CodeList List(std::uint32_t word) const;
  // The number of the list's first code among all codes.
  std::size_t First(std::uint32_t word) const { return offsets_[word * pages_]; }
  // Of the i-th code of the list; ascending.
  std::uint32_t Image(std::uint32_t word, std::size_t i) const;
  // Calls `visit` for each image with the word, ascending, and its number of occurrences.
  template <typename Visit>  // void(std::size_t image, std::size_t count)
  void ForEachCount(std::uint32_t word, Visit&& visit) const {
    const std::uint8_t* const images = images_.data();
    const std::uint32_t* const offsets = &offsets_[word * pages_];
    for (std::size_t page = 0; page < pages_; ++page) {
      const std::size_t end = offsets[page + 1];
      for (std::size_t i = offsets[page]; i < end;) {
        const std::size_t first = i;
        const std::uint8_t image = images[i];
        while (++i < end && images[i] == image) continue;
        visit(page * kPage + image, i - first);
      }
    }
  }
  // The words of an image with their codes, as Build got them.
  Bow BowOf(std::size_t image) const;
  std::size_t memory_bytes() const;

 private:
  struct Entry {
    std::uint32_t image = 0;
    std::int16_t bias = 0;
    std::size_t code = 0;  // position in the bytes that go with the entries
  };
  static constexpr std::size_t kPage = 256;

  void SetImages(std::size_t images) {
    pages_ = std::max<std::size_t>(1, (images + kPage - 1) / kPage);
  }
  // Words must come in ascending order, each once; entries ascending by image.
  void AddWord(std::span<const Entry> entries, const std::vector<std::uint8_t>& codes);
  void Finish();  // after all words

  std::size_t bytes_ = 0;  // per code
  std::size_t pages_ = 1;
  // Codes of word w on page p are [offsets_[w * pages_ + p], offsets_[w * pages_ + p + 1]).
  std::vector<std::uint32_t> offsets_{0};
  std::vector<std::uint8_t> images_;  // of each code, on its page
  std::vector<std::int16_t> biases_;  // empty for binary descriptors
  std::vector<std::uint8_t> codes_;   // in the layout of CodeList, and kCodePadding bytes
  bool binary_ = false;
};

}  // namespace pliant
