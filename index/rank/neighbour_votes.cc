// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/neighbour_votes.h"

#include <algorithm>

#include "descriptor/base/parallel.h"

namespace pliant {

struct NeighbourQuery::Scratch {
  std::vector<float> best;             // by picture: of the present row's votes
  std::vector<std::uint16_t> touched;  // pictures with a vote
  std::vector<NearCode> near;
};

NeighbourQuery::NeighbourQuery(const Quantizer& quantizer, const Descriptors& descriptors,
                               const NeighbourOptions& options)
    : descriptors_(descriptors), bias_step_(quantizer.coder()->bias_step()) {
  const ResidualCoder& coder = *quantizer.coder();
  const std::vector<NearWord> words =
      quantizer.NearestWords(descriptors, options.cells, options.threads);
  if (descriptors.rows == 0) return;
  cells_per_row_ = words.size() / descriptors.rows;
  limits_.resize(descriptors.rows);
  cells_.reserve(words.size());
  for (const NearWord& word : words) {
    cells_.push_back({word.word, coder.binary() ? word.distance : word.distance * word.distance});
  }
  for (std::size_t row = 0; row < descriptors.rows; ++row) {
    limits_[row] = options.reach * cells_[row * cells_per_row_].base;
    most_ += limits_[row];
  }
  if (coder.binary()) return;
  tables_.resize(descriptors.rows);
  constexpr std::size_t kRowsATask = 64;
  ParallelFor((descriptors.rows + kRowsATask - 1) / kRowsATask, options.threads,
              [&](std::size_t task) {
                const std::size_t end = std::min(descriptors.rows, (task + 1) * kRowsATask);
                for (std::size_t row = task * kRowsATask; row < end; ++row) {
                  tables_[row] = coder.TableOf(descriptors.float_row(row));
                }
              });
}

void NeighbourQuery::AddVotes(const CodeLists& lists, std::vector<float>* sums) const {
  Scratch scratch;
  scratch.best.assign(sums->size(), 0.0F);
  for (std::size_t row = 0; row < limits_.size(); ++row) {
    Vote(lists, row, &scratch);
    for (const std::uint16_t picture : scratch.touched) {
      (*sums)[picture] += scratch.best[picture];
      scratch.best[picture] = 0;
    }
    scratch.touched.clear();
  }
}

void NeighbourQuery::Vote(const CodeLists& lists, std::size_t row, Scratch* scratch) const {
  CodeQuery query;
  query.limit = limits_[row];
  query.bias_step = bias_step_;
  if (tables_.empty()) {
    query.bits = descriptors_.binary_row(row);
  } else {
    query.table = &tables_[row];
  }
  for (std::size_t c = 0; c < cells_per_row_; ++c) {
    const Cell& cell = cells_[row * cells_per_row_ + c];
    const CodeList list = lists.List(cell.word);
    if (list.size == 0) continue;
    scratch->near.resize(std::max(scratch->near.size(), list.size));
    query.base = cell.base;
    const std::size_t found = ScanCodes(list, query, scratch->near.data());
    const std::uint16_t* pictures = lists.Pictures(cell.word);
    for (std::size_t i = 0; i < found; ++i) {
      const NearCode& near = scratch->near[i];
      const std::uint16_t picture = pictures[near.index];
      const float vote = query.limit - near.squared_distance;
      float& best = scratch->best[picture];
      if (best == 0) scratch->touched.push_back(picture);
      best = std::max(best, vote);
    }
  }
}

}  // namespace pliant
