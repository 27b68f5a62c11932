// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An immutable piece of the inverted index: up to 16384 images, and the codes of their
// descriptors word by word. Private to index/.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "index/rank/code_lists.h"
#include "index/records/image_ref.h"

namespace pliant {

class IndexSegment {
 public:
  static constexpr std::size_t kMaxImages = 16384;

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

  std::size_t size() const { return keys_.size(); }
  std::int64_t key(std::size_t image) const { return keys_[image]; }
  std::int64_t object(std::size_t image) const { return objects_[image]; }
  std::string_view id(std::size_t image) const {
    return std::string_view(id_text_).substr(id_offsets_[image],
                                             id_offsets_[image + 1] - id_offsets_[image]);
  }
  double total(std::size_t image) const { return totals_[image]; }            // keypoints
  double sum_of_squares(std::size_t image) const { return squares_[image]; }  // of the counts
  const CodeLists& codes() const { return codes_; }

  // Position of a key, or size().
  std::size_t Find(std::int64_t key) const;
  Bow BowOf(std::size_t image) const { return codes_.BowOf(image); }

  std::size_t memory_bytes() const;

 private:
  void Reserve(std::size_t images);
  void AddImage(std::int64_t key, std::int64_t object, std::string_view id, double total,
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
