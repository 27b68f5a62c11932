// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/neighbour_votes.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "descriptor/base/parallel.h"

namespace pliant {
namespace {

// A picture with hardly any descriptor must not come first by one vote.
constexpr double kLeastDescriptors = 8;

double Root(double descriptors) { return std::sqrt(std::max(kLeastDescriptors, descriptors)); }

}  // namespace

// Of the present row: the best vote of each picture.
struct NeighbourQuery::Scratch {
  std::vector<float> best;  // by picture; 0 = none
  std::vector<std::uint64_t> code;
  std::vector<std::uint16_t> touched;
  std::vector<NearCode> near;
};

NeighbourQuery::NeighbourQuery(const Quantizer& quantizer, const Descriptors& descriptors,
                               const NeighbourOptions& options)
    : descriptors_(descriptors), bias_step_(quantizer.coder()->bias_step()) {
  if (descriptors.rows == 0) return;
  const ResidualCoder& coder = *quantizer.coder();
  const std::vector<NearWord> words =
      quantizer.NearestWords(descriptors, options.cells, options.threads);
  cells_per_row_ = words.size() / descriptors.rows;
  cells_.reserve(words.size());
  for (const NearWord& word : words) {
    cells_.push_back({word.word, coder.binary() ? word.distance : word.distance * word.distance});
  }
  double most = 0;
  for (std::size_t row = 0; row < descriptors.rows; ++row) {
    limits_.push_back(options.reach * cells_[row * cells_per_row_].base);
    most += limits_.back();
  }
  if (most > 0) norm_ = Root(static_cast<double>(descriptors.rows)) / most;
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

void NeighbourQuery::Collect(const CodeLists& lists, std::size_t pictures,
                             const std::vector<bool>* dead, std::vector<Vote>* votes) const {
  Scratch scratch;
  scratch.best.assign(pictures, 0.0F);
  scratch.code.resize(pictures);
  for (std::size_t row = 0; row < limits_.size(); ++row) {
    VoteOf(row, lists, dead, &scratch);
    std::sort(scratch.touched.begin(), scratch.touched.end());
    for (const std::uint16_t picture : scratch.touched) {
      votes->push_back(
          {static_cast<std::uint32_t>(row), picture, scratch.code[picture], scratch.best[picture]});
      scratch.best[picture] = 0;
    }
    scratch.touched.clear();
  }
}

void NeighbourQuery::VoteOf(std::size_t row, const CodeLists& lists, const std::vector<bool>* dead,
                            Scratch* scratch) const {
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
      if (vote <= scratch->best[picture] || (dead != nullptr && (*dead)[picture])) continue;
      if (scratch->best[picture] == 0) scratch->touched.push_back(picture);
      scratch->best[picture] = vote;
      scratch->code[picture] = lists.First(cell.word) + near.index;
    }
  }
}

void NeighbourQuery::WeighByRarity(std::span<std::vector<Vote>> votes_of_lists) const {
  std::vector<std::uint32_t> pictures(limits_.size(), 0);
  for (const std::vector<Vote>& votes : votes_of_lists) {
    for (const Vote& vote : votes) ++pictures[vote.row];
  }
  for (std::vector<Vote>& votes : votes_of_lists) {
    for (Vote& vote : votes) vote.weight /= std::sqrt(static_cast<float>(pictures[vote.row]));
  }
}

double NeighbourQuery::Score(double sum, double descriptors) const {
  return std::min(1.0, sum * norm_ / Root(descriptors));
}

void SumVotes(std::vector<Vote>* votes, std::vector<float>* sums) {
  std::sort(votes->begin(), votes->end(), [](const Vote& a, const Vote& b) {
    return std::tuple(a.picture, a.code, -a.weight, a.row) <
           std::tuple(b.picture, b.code, -b.weight, b.row);
  });
  float rank = 0;
  for (std::size_t i = 0; i < votes->size(); ++i) {
    const Vote& vote = (*votes)[i];
    const bool again =
        i > 0 && (*votes)[i - 1].picture == vote.picture && (*votes)[i - 1].code == vote.code;
    rank = again ? rank + 1 : 1;
    (*sums)[vote.picture] += vote.weight / rank;
  }
}

}  // namespace pliant
