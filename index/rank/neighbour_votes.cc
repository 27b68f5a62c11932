// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/rank/neighbour_votes.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "descriptor/base/parallel.h"

namespace pliant {
namespace {

// Lists are prefetched this many cells before they are read.
constexpr std::size_t kCellsAhead = 2;

}  // namespace

NeighbourQuery::NeighbourQuery(const ResidualCoder& coder, const Voters& voters,
                               std::span<const NearWord> words, const NeighbourOptions& options)
    : voters_(voters),
      bias_step_(coder.bias_step()),
      least_descriptors_(options.least_descriptors) {
  const Descriptors& descriptors = voters.descriptors;
  if (descriptors.rows == 0) return;
  const std::size_t cells_per_row = words.size() / descriptors.rows;
  cells_.reserve(words.size());
  double most = 0;
  double voices = 0;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const auto [word, distance] = words[i];
    const float base = coder.binary() ? distance : distance * distance;
    cells_.push_back({word, static_cast<std::uint32_t>(i / cells_per_row), base});
    if (i % cells_per_row != 0) continue;
    const float farthest = words[i + cells_per_row - 1].distance;
    const float usual = options.least * (coder.binary() ? farthest : farthest * farthest);
    limits_.push_back(options.reach * std::max(base, usual));
    const double weight = WeightOf(limits_.size() - 1);
    most += weight * limits_.back();
    voices += weight;
  }
  std::sort(cells_.begin(), cells_.end(), [](const Cell& a, const Cell& b) {
    return std::pair(a.word, a.row) < std::pair(b.word, b.row);
  });
  if (most > 0) norm_ = Root(voices) / most;
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

double NeighbourQuery::Root(double descriptors) const {
  return std::sqrt(std::max(least_descriptors_, descriptors));
}

float NeighbourQuery::WeightOf(std::size_t row) const {
  return voters_.weights.empty() ? 1 : voters_.weights[row];
}

void NeighbourQuery::Collect(const CodeLists& lists, const std::vector<bool>* dead,
                             std::size_t slice, std::size_t slices,
                             std::vector<Vote>* votes) const {
  const std::size_t end = cells_.size() * (slice + 1) / slices;
  CodeQuery query;
  query.bias_step = bias_step_;
  std::vector<NearCode> near;
  for (std::size_t c = cells_.size() * slice / slices; c < end; ++c) {
    const Cell& cell = cells_[c];
    if (c + kCellsAhead < end) Prefetch(lists.List(cells_[c + kCellsAhead].word));
    const CodeList list = lists.List(cell.word);
    if (list.size == 0) continue;
    near.resize(std::max(near.size(), list.size));
    query.limit = limits_[cell.row];
    query.base = cell.base;
    if (tables_.empty()) {
      query.bits = voters_.descriptors.binary_row(cell.row);
    } else {
      query.table = &tables_[cell.row];
    }
    const auto images = lists.Images(cell.word);
    const std::size_t found = ScanCodes(list, query, near.data());
    for (std::size_t i = 0; i < found; ++i) {
      const std::uint32_t image = images[near[i].index];
      const float weight = query.limit - near[i].squared_distance;
      if (dead != nullptr && (*dead)[image]) continue;
      votes->push_back({cell.row, image, lists.First(cell.word) + near[i].index, weight});
    }
  }
}

void KeepBest(std::vector<Vote>* votes) {
  std::sort(votes->begin(), votes->end(), [](const Vote& a, const Vote& b) {
    return std::tuple(a.row, a.image, -a.weight, a.code) <
           std::tuple(b.row, b.image, -b.weight, b.code);
  });
  const auto same = [](const Vote& a, const Vote& b) {
    return a.row == b.row && a.image == b.image;
  };
  votes->erase(std::unique(votes->begin(), votes->end(), same), votes->end());
}

void NeighbourQuery::Weigh(std::span<const std::uint32_t> images_of_row,
                           std::vector<Vote>* votes) const {
  for (Vote& vote : *votes) {
    vote.weight *= WeightOf(vote.row) / std::sqrt(static_cast<float>(images_of_row[vote.row]));
  }
}

double NeighbourQuery::Score(double sum, double descriptors) const {
  return std::min(1.0, sum * norm_ / Root(descriptors));
}

void SumVotes(std::vector<Vote>* votes, std::vector<float>* sums) {
  std::sort(votes->begin(), votes->end(), [](const Vote& a, const Vote& b) {
    return std::tuple(a.image, a.code, -a.weight, a.row) <
           std::tuple(b.image, b.code, -b.weight, b.row);
  });
  float rank = 0;
  for (std::size_t i = 0; i < votes->size(); ++i) {
    const Vote& vote = (*votes)[i];
    const bool again =
        i > 0 && (*votes)[i - 1].image == vote.image && (*votes)[i - 1].code == vote.code;
    rank = again ? rank + 1 : 1;
    (*sums)[vote.image] += vote.weight / rank;
  }
}

}  // namespace pliant
