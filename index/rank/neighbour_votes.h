// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranking by nearest neighbours: each descriptor of the query votes for the images that have
// descriptors near it. Private to index/.
//
// Let w be the nearest word of the query descriptor q, and |q - w| its distance. A descriptor x in
// one of the cells (words) nearest to q votes
//   v = max(0, a max(|q - w|^2, b |q - w'|^2) - |q - x|^2)
// for its image, the best once per query descriptor and image. w' is the farthest of these cells'
// words, a second measure of the usual distance: a descriptor can be a word itself (or several)
// because it is stored many times or the collection is small. The weight is relative, as in local
// naive Bayes nearest neighbour (McCann and Lowe, CVPR 2012), with a |q - w|^2 instead of the
// distance to the second nearest class. Much of a photograph resembles everything: only descriptors
// nearer than usual (than the word) are evidence. Distances are estimated from codes
// (vocab/residual_codes.h).
//
// Votes are then weighted:
//  - by the query descriptor's own weight (Voters);
//  - by rarity: of a query descriptor that votes for m images, each vote counts v / sqrt(m);
//  - against bursts (Jegou, Douze and Schmid, "On the burstiness of visual elements", CVPR 2009):
//  of
//    the votes that one descriptor x gets, the i-th largest counts 1 / i.
// An image's sum is divided by the square root of its number of descriptors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "index/rank/code_lists.h"
#include "vocab/quantizer.h"

namespace pliant {

// A query's descriptors, and the weights of their votes.
struct Voters {
  const Descriptors& descriptors;
  std::span<const float> weights = {};  // by row, above 0; empty: 1 each
};

// Measured with tests/bench/bench_neighbours.cc (--reach, --cells).
struct NeighbourOptions {
  int cells = 16;                // nearest words whose lists each query descriptor scans
  float reach = 0.7F;            // a
  int threads = 1;               // 0 = all cores
  float least = 0.3F;            // b
  double least_descriptors = 8;  // one vote must not put an image with fewer first
  // From so many words on, half of the cells find the same images in little more than half of the
  // time (index/RANKING.md).
  std::size_t many_words = 32'768;
};

struct Vote {
  std::uint32_t row = 0;    // of the query
  std::uint32_t image = 0;  // position in the lists' segment
  std::uint64_t code = 0;   // number of the code in the lists
  float weight = 0;
};

// A query's descriptors, prepared for comparison with any number of lists. Immutable and
// thread-safe.
class NeighbourQuery {
 public:
  // `words`: the nearest words of each row (Quantizer::NearestWords), row by row. The data in
  // `voters` must outlive it.
  NeighbourQuery(const ResidualCoder& coder, const Voters& voters, std::span<const NearWord> words,
                 const NeighbourOptions& options);

  // Appends the votes for the lists' living images, in no order, perhaps several of a row for one
  // image (KeepBest). Slice `slice` of `slices` scans its share of the cells. `dead`: nullptr = all
  // are alive.
  void Collect(const CodeLists& lists, const std::vector<bool>* dead, std::size_t slice,
               std::size_t slices, std::vector<Vote>* votes) const;

  // Multiplies each vote by the weight of its row, and divides it by the square root of the number
  // of images for which its row votes, over all lists.
  void Weigh(std::span<const std::uint32_t> images_of_row, std::vector<Vote>* votes) const;

  // The score of an image with `descriptors` descriptors whose votes add up to `sum`: 1 for a copy
  // of the query that resembles nothing else.
  double Score(double sum, double descriptors) const;

 private:
  struct Cell {
    std::uint32_t word = 0;
    std::uint32_t row = 0;
    float base = 0;  // |q - word|^2
  };

  float WeightOf(std::size_t row) const;
  double Root(double descriptors) const;

  Voters voters_;
  float bias_step_ = 0;
  // By word, then by row: a list that several rows need is read from memory once.
  std::vector<Cell> cells_;
  std::vector<LookupTable> tables_;  // by row; none for binary descriptors
  std::vector<float> limits_;        // by row: a |q - w|^2
  double least_descriptors_;
  double norm_ = 0;  // 1 / (sum of weighed limits_ / sqrt(sum of weights))
};

// Keeps the best of each row's votes for an image (of equal votes the one with the lowest code), by
// row, then by image.
void KeepBest(std::vector<Vote>* votes);

// sums[image] = its votes, weighed against bursts. Sorts `votes`.
void SumVotes(std::vector<Vote>* votes, std::vector<float>* sums);

}  // namespace pliant
