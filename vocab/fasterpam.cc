// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/fasterpam.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

namespace pliant {
namespace {

constexpr std::size_t kSearchBlock = 512;  // samples whose distances are gathered at a time

}  // namespace

FasterPam::FasterPam(const DistanceRows& rows, std::vector<std::uint32_t> medoids)
    : rows_(rows),
      medoids_(std::move(medoids)),
      is_medoid_(rows.size(), 0),
      nearest_(rows.size()),
      second_(rows.size()),
      nearest_distance_(rows.size()),
      second_distance_(rows.size()),
      removal_loss_(medoids_.size()) {
  for (const std::uint32_t m : medoids_) is_medoid_[m] = 1;
  std::vector<std::uint32_t> all(rows.size());
  std::iota(all.begin(), all.end(), 0U);
  Search(all);
  UpdateSums();
}

void FasterPam::Search(const std::vector<std::uint32_t>& samples) {
  const std::size_t k = medoids_.size();
  for (std::size_t first = 0; first < samples.size(); first += kSearchBlock) {
    const std::span block(samples.data() + first, std::min(kSearchBlock, samples.size() - first));
    rows_.Gather(block, medoids_, &gathered_);
    for (std::size_t i = 0; i < block.size(); ++i) {
      const float* distances = gathered_.data() + i * k;
      std::uint32_t best = 0;
      std::uint32_t second = 1;
      if (distances[second] < distances[best]) std::swap(best, second);
      for (std::uint32_t m = 2; m < k; ++m) {
        if (distances[m] >= distances[second]) continue;
        second = m;
        if (distances[second] < distances[best]) std::swap(best, second);
      }
      const std::uint32_t o = block[i];
      nearest_[o] = best;
      second_[o] = second;
      nearest_distance_[o] = distances[best];
      second_distance_[o] = distances[second];
    }
  }
}

// removal_loss_: when a medoid goes, its samples move to their second nearest, and no others move
// (the paper's Delta TD^-). Sums anew instead of adding changes up, so that no rounding error
// gathers over the swaps.
void FasterPam::UpdateSums() {
  std::fill(removal_loss_.begin(), removal_loss_.end(), 0.0);
  loss_ = 0;
  for (std::size_t o = 0; o < rows_.size(); ++o) {
    loss_ += nearest_distance_[o];
    removal_loss_[nearest_[o]] +=
        static_cast<double>(second_distance_[o]) - static_cast<double>(nearest_distance_[o]);
  }
}

Swap FasterPam::Evaluate(const float* distances, std::vector<double>* scratch) const {
  // change[i]: of removing medoid i and adding the candidate, less what the candidate saves
  // whichever medoid goes (`saved`). With d the distance to the candidate, a sample's share is
  //   saved += min(d - nearest, 0),  change[its medoid] += min(max(d, nearest), second) - second,
  // written without branches, which would be mispredicted; but few samples have the candidate
  // nearer than their second medoid when k is large, so chunks without one are left out.
  std::vector<double>& change = *scratch;
  change.assign(removal_loss_.begin(), removal_loss_.end());
  constexpr std::size_t kChunk = 16;
  double saved[kChunk] = {};
  double less[kChunk];
  const std::size_t n = rows_.size();
  for (std::size_t first = 0; first < n; first += kChunk) {
    const std::size_t count = std::min(kChunk, n - first);
    const float* d = distances + first;
    const float* near = nearest_distance_.data() + first;
    const float* second = second_distance_.data() + first;
    const std::uint32_t* medoid = nearest_.data() + first;
    int any = 0;
    for (std::size_t j = 0; j < count; ++j) any |= static_cast<int>(d[j] < second[j]);
    if (any == 0) continue;
    for (std::size_t j = 0; j < count; ++j) {
      saved[j] += static_cast<double>(std::min(d[j], near[j])) - static_cast<double>(near[j]);
      less[j] = static_cast<double>(std::min(std::max(d[j], near[j]), second[j])) -
                static_cast<double>(second[j]);
    }
    for (std::size_t j = 0; j < count; ++j) change[medoid[j]] += less[j];
  }
  const auto best = std::min_element(change.begin(), change.end());
  return {static_cast<std::uint32_t>(best - change.begin()),
          *best + std::accumulate(saved, saved + kChunk, 0.0)};
}

void FasterPam::Apply(std::uint32_t position, std::uint32_t candidate, const float* distances) {
  is_medoid_[medoids_[position]] = 0;
  is_medoid_[candidate] = 1;
  medoids_[position] = candidate;
  orphans_.clear();
  for (std::size_t o = 0; o < rows_.size(); ++o) {
    const float d = distances[o];
    if (nearest_[o] == position || second_[o] == position) {
      // One of the two went away. Where the candidate takes its place or a better one, the other
      // of the two is still right; else the next nearest must be looked for.
      const bool was_nearest = nearest_[o] == position;
      const std::uint32_t kept = was_nearest ? second_[o] : nearest_[o];
      const float kept_distance = was_nearest ? second_distance_[o] : nearest_distance_[o];
      if (d > second_distance_[o]) {
        orphans_.push_back(static_cast<std::uint32_t>(o));
      } else if (d < kept_distance) {
        nearest_[o] = position;
        nearest_distance_[o] = d;
        second_[o] = kept;
        second_distance_[o] = kept_distance;
      } else {
        nearest_[o] = kept;
        nearest_distance_[o] = kept_distance;
        second_[o] = position;
        second_distance_[o] = d;
      }
    } else if (d < nearest_distance_[o]) {
      second_[o] = nearest_[o];
      second_distance_[o] = nearest_distance_[o];
      nearest_[o] = position;
      nearest_distance_[o] = d;
    } else if (d < second_distance_[o]) {
      second_[o] = position;
      second_distance_[o] = d;
    }
  }
  Search(orphans_);
  UpdateSums();
}

}  // namespace pliant
