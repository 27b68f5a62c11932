// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An immutable piece of the inverted index: up to 16384 pictures, and the codes of their
// descriptors word by word. Private to index/.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "index/rank/code_lists.h"
#include "index/records/indexed_picture.h"

namespace pliant {

class IndexSegment {
 public:
  static constexpr std::size_t kMaxPictures = 16384;

  // `pictures`: at most kMaxPictures, keys ascending; words below `vocabulary_size`, and a code for
  // each descriptor (CodeLists::Build).
  static std::shared_ptr<const IndexSegment> Build(std::span<const IndexedPicture> pictures,
                                                   std::size_t vocabulary_size,
                                                   const ResidualCoder& coder);
  struct Source {
    const IndexSegment* segment;
    const std::vector<bool>* dead;  // nullptr = none
  };
  // The living pictures of all sources, keys ascending.
  static std::shared_ptr<const IndexSegment> Merge(std::span<const Source> sources);

  std::size_t size() const { return keys_.size(); }
  std::int64_t key(std::size_t picture) const { return keys_[picture]; }
  std::int64_t object(std::size_t picture) const { return objects_[picture]; }
  std::string_view id(std::size_t picture) const {
    return std::string_view(id_text_).substr(id_offsets_[picture],
                                             id_offsets_[picture + 1] - id_offsets_[picture]);
  }
  double total(std::size_t picture) const { return totals_[picture]; }            // key points
  double sum_of_squares(std::size_t picture) const { return squares_[picture]; }  // of the counts
  const CodeLists& codes() const { return codes_; }

  // Position of a key, or size().
  std::size_t Find(std::int64_t key) const;
  Bow BowOf(std::size_t picture) const { return codes_.BowOf(picture); }

  std::size_t memory_bytes() const;

 private:
  void Reserve(std::size_t pictures);
  void AddPicture(std::int64_t key, std::int64_t object, std::string_view id, double total,
                  double squares);

  std::vector<std::int64_t> keys_;  // ascending
  std::vector<std::int64_t> objects_;
  std::vector<std::uint32_t> id_offsets_{0};
  std::string id_text_;
  std::vector<double> totals_;
  std::vector<double> squares_;
  CodeLists codes_;
};

}  // namespace pliant
