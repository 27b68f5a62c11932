// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ranking by nearest neighbours: each descriptor of the query votes for the pictures that have
// descriptors near it. Private to index/.
//
// Let w be the nearest word of the query descriptor q, and |q - w| its distance. A descriptor x in
// one of the cells (words) nearest to q votes
//   max(0, a |q - w|^2 - |q - x|^2),
// the best once per query descriptor and picture. The weight is relative, as in local naive Bayes
// nearest neighbour (McCann and Lowe, CVPR 2012), where the distance to the second nearest class
// takes the place of a |q - w|^2: much of a photograph is like everything, and only what is nearer
// than the word, that is than the usual, says something. This form needs no second neighbour, so
// votes add up over segments, threads and machines. Distances are estimated from codes
// (vocab/residual_codes.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "index/rank/code_lists.h"
#include "vocab/quantizer.h"

namespace pliant {

struct NeighbourOptions {
  int cells = 16;      // nearest words whose lists a query descriptor looks into
  float reach = 0.8F;  // a
  int threads = 1;     // 0 = all cores
};

// A query's descriptors, ready to be compared with any number of lists.
class NeighbourQuery {
 public:
  // The quantizer must have a coder. `descriptors` must outlive it.
  NeighbourQuery(const Quantizer& quantizer, const Descriptors& descriptors,
                 const NeighbourOptions& options);

  // sums[p] += the votes for picture p of the lists; `sums` has an entry per picture. The order of
  // additions is the query's, so that sums depend on the picture alone.
  void AddVotes(const CodeLists& lists, std::vector<float>* sums) const;

  // What an exact copy of the query would get.
  double most() const { return most_; }
  std::size_t rows() const { return limits_.size(); }

 private:
  struct Cell {
    std::uint32_t word = 0;
    float base = 0;  // |q - word|^2
  };
  struct Scratch;
  void Vote(const CodeLists& lists, std::size_t row, Scratch* scratch) const;

  const Descriptors& descriptors_;
  float bias_step_ = 0;
  std::size_t cells_per_row_ = 0;
  std::vector<Cell> cells_;          // rows x cells_per_row_
  std::vector<LookupTable> tables_;  // by row; none for binary descriptors
  std::vector<float> limits_;        // by row: a |q - w|^2
  double most_ = 0;
};

}  // namespace pliant
