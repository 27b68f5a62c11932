// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The codes of a segment's descriptors (vocab/residual_codes.h), word by word: what ranking by
// nearest neighbours scans. Private to index/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "index/records/indexed_picture.h"
#include "vocab/code_scan.h"
#include "vocab/residual_codes.h"

namespace pliant {

// Immutable. Within a word codes come in order of the picture.
class CodeLists {
 public:
  static constexpr std::uint32_t kGone = std::numeric_limits<std::uint32_t>::max();

  // pictures[p] is at position p, below 65536. Each must have a code for each of its descriptors
  // (Bow::codes); throws kCorrupt "codes_missing" otherwise.
  static std::shared_ptr<const CodeLists> Build(std::span<const IndexedPicture> pictures,
                                                std::size_t vocabulary_size,
                                                const ResidualCoder& coder);
  struct Source {
    const CodeLists* lists = nullptr;
    const std::vector<std::uint32_t>* position = nullptr;  // in the result, by picture; or kGone
  };
  static std::shared_ptr<const CodeLists> Merge(std::span<const Source> sources);

  std::size_t vocabulary_size() const { return offsets_.size() - 1; }
  CodeList List(std::uint32_t word) const;
  std::uint64_t First(std::uint32_t word) const { return offsets_[word]; }
  // Of each code of the list, ascending.
  const std::uint16_t* Pictures(std::uint32_t word) const {
    return pictures_.data() + offsets_[word];
  }
  std::size_t memory_bytes() const;

 private:
  struct Entry {
    std::uint32_t picture = 0;
    std::int16_t bias = 0;
    std::size_t code = 0;  // position in the bytes that go with the entries
  };
  // Words must come in ascending order, each once; entries ascending by picture.
  void AddWord(std::span<const Entry> entries, const std::vector<std::uint8_t>& codes);
  void Finish();

  std::size_t bytes_ = 0;  // per code
  std::vector<std::uint64_t> offsets_{0};
  std::vector<std::uint16_t> pictures_;
  std::vector<std::int16_t> biases_;  // empty for binary descriptors
  std::vector<std::uint8_t> codes_;   // in the layout of CodeList, and kCodePadding bytes
  bool binary_ = false;
};

}  // namespace pliant
