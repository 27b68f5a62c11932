// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An immutable piece of the inverted index: up to 16384 pictures and their posting lists. Private
// to index/.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "index/records/indexed_picture.h"
#include "vocab/quantizer.h"
#include "vocab/signature.h"

namespace pliant {

struct Posting {
  std::uint32_t picture = 0;  // position in the segment
  std::uint32_t count = 0;
  std::uint64_t signature = 0;  // 0 in a segment without signatures
};

// What each number of differing bits between two signatures is worth.
using BitWeights = std::array<float, kSignatureBits + 1>;

class IndexSegment {
 public:
  static constexpr std::size_t kMaxPictures = 16384;
  static constexpr std::uint32_t kNoRow = std::numeric_limits<std::uint32_t>::max();

  // `pictures`: at most kMaxPictures, keys ascending; words below `vocabulary_size`; all of them
  // with signatures or none.
  static std::shared_ptr<const IndexSegment> Build(std::span<const IndexedPicture> pictures,
                                                   std::size_t vocabulary_size);
  struct Source {
    const IndexSegment* segment;
    const std::vector<bool>* dead;  // nullptr = none
  };
  // The living pictures of all sources, keys ascending.
  static std::shared_ptr<const IndexSegment> Merge(std::span<const Source> sources);

  std::size_t size() const { return keys_.size(); }
  std::size_t vocabulary_size() const { return offsets_.size() - 1; }
  std::int64_t key(std::size_t picture) const { return keys_[picture]; }
  std::int64_t object(std::size_t picture) const { return objects_[picture]; }
  std::string_view id(std::size_t picture) const {
    return std::string_view(id_text_).substr(id_offsets_[picture],
                                             id_offsets_[picture + 1] - id_offsets_[picture]);
  }
  double total(std::size_t picture) const { return totals_[picture]; }            // key points
  double sum_of_squares(std::size_t picture) const { return squares_[picture]; }  // of the counts

  // Position of a key, or size().
  std::size_t Find(std::int64_t key) const;
  // Positions ascending, one entry a picture.
  std::vector<Posting> PostingsOf(std::uint32_t word) const;
  Bow BowOf(std::size_t picture) const;

  // sums[p] += weight * count of `word` in picture p, for all p. `sums` has size() entries.
  void Accumulate(std::uint32_t word, float weight, float* sums) const;
  bool has_signatures() const { return !signature_offsets_.empty(); }
  // sums[p] += weights[bits in which the picture's signature of `word` differs from `signature`],
  // for all p that have the word. Only when has_signatures().
  void AccumulateAlike(std::uint32_t word, std::uint64_t signature, const BitWeights& weights,
                       float* sums) const;
  // sums[p] += weight for all p that have the word.
  void AccumulatePresence(std::uint32_t word, double weight, double* sums) const;

  // sums[p] += (weight * count)^2.
  void AccumulateSquares(std::uint32_t word, double weight, double* sums) const;

  std::size_t memory_bytes() const;

 private:
  void AddPicture(std::int64_t key, std::int64_t object, std::string_view id, double total,
                  double squares);
  // Words must come in ascending order, each once; postings ascending.
  void AddWord(std::span<const Posting> postings);
  void BeginSignatures() { signature_offsets_.assign(1, 0); }
  void AddSignatures(std::uint32_t word, std::vector<Posting>* postings) const;
  std::uint64_t SignatureOf(std::uint32_t word, std::size_t picture) const;
  // Calls visit(picture) for each picture that has the word, ascending, once.
  template <typename Visit>
  void ForEachPicture(std::uint32_t word, Visit&& visit) const;

  std::vector<std::int64_t> keys_;  // ascending
  std::vector<std::int64_t> objects_;
  std::vector<std::uint32_t> id_offsets_{0};
  std::string id_text_;
  std::vector<double> totals_;
  std::vector<double> squares_;
  // Postings of word w are [offsets_[w], offsets_[w + 1]) of pictures_ and counts_. A count above
  // 255 is split into several postings of one picture. A word that a third or more of the pictures
  // have has a row of size() counts in dense_ instead; only what exceeds 255 is a posting.
  std::vector<std::uint32_t> offsets_{0};
  std::vector<std::uint16_t> pictures_;
  std::vector<std::uint8_t> counts_;
  std::vector<std::uint32_t> dense_rows_;  // row of each word or kNoRow; empty = no dense words
  std::vector<std::uint8_t> dense_;
  // Signatures of word w are [signature_offsets_[w], signature_offsets_[w + 1]), one for each
  // picture that has it, in the pictures' order. Both empty in a segment without.
  std::vector<std::uint32_t> signature_offsets_;
  std::vector<std::uint64_t> signatures_;
};

}  // namespace pliant
