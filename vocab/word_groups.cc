// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/word_groups.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "vocab/k_medoids.h"

namespace pliant {
namespace {

// Measured on photographs; see vocab/README.md.
constexpr std::size_t kLookedInto = 40;
constexpr double kGroupsARoot = 2;        // groups for the square root of the number of words
constexpr std::size_t kClustered = 4096;  // words that k-medoids sees
constexpr int kMoves = 3;

bool Nearer(const NearWord& a, const NearWord& b) {
  return a.distance < b.distance || (a.distance == b.distance && a.word < b.word);
}

// `nearest` is sorted; the farthest makes room.
void Offer(NearWord word, std::span<NearWord> nearest) {
  if (!Nearer(word, nearest.back())) return;
  std::size_t at = nearest.size() - 1;
  for (; at > 0 && Nearer(word, nearest[at - 1]); --at) nearest[at] = nearest[at - 1];
  nearest[at] = word;
}

// Some of the words, by k-medoids of a part of them.
Descriptors ChooseCentres(const Descriptors& words) {
  std::vector<std::uint32_t> drawn(words.rows);
  std::iota(drawn.begin(), drawn.end(), 0U);
  std::mt19937_64 random(1);
  const std::size_t count = std::min(kClustered, words.rows);
  for (std::size_t i = 0; i < count; ++i) {
    std::swap(drawn[i], drawn[i + random() % (drawn.size() - i)]);
  }
  drawn.resize(count);
  std::sort(drawn.begin(), drawn.end());
  const Descriptors sample = SelectRows(words, drawn);
  KMedoidsOptions options;
  options.k = static_cast<int>(std::min(static_cast<double>(count),
                                        kGroupsARoot * std::sqrt(static_cast<double>(words.rows))));
  options.max_passes = 1;
  options.threads = 1;
  return SelectRows(sample, KMedoids(sample, options).medoids);
}

std::vector<NearestTwo> NearestOf(const Descriptors& words, const Descriptors& centres) {
  std::vector<NearestTwo> nearest(words.rows);
  PackedDescriptors(centres).FindNearest(words, 0, words.rows, nearest.data());
  return nearest;
}

// Moves each centre to the mean of its words (Lloyd's iteration of k-means). Floats only.
void MoveToMeans(const Descriptors& words, Descriptors* centres) {
  const auto dim = static_cast<std::size_t>(words.dim);
  const std::vector<NearestTwo> nearest = NearestOf(words, *centres);
  std::vector<double> sums(centres->floats.size());
  std::vector<std::size_t> counts(centres->rows);
  for (std::size_t w = 0; w < words.rows; ++w) {
    const std::size_t c = nearest[w].index;
    ++counts[c];
    for (std::size_t d = 0; d < dim; ++d) sums[c * dim + d] += words.floats[w * dim + d];
  }
  for (std::size_t c = 0; c < centres->rows; ++c) {
    if (counts[c] == 0) continue;
    for (std::size_t d = 0; d < dim; ++d) {
      centres->floats[c * dim + d] =
          static_cast<float>(sums[c * dim + d] / static_cast<double>(counts[c]));
    }
  }
}

Descriptors MakeCentres(const Descriptors& words) {
  Descriptors centres = ChooseCentres(words);
  if (words.kind != DescriptorKind::kFloat) return centres;
  for (int i = 0; i < kMoves; ++i) MoveToMeans(words, &centres);
  return centres;
}

}  // namespace

WordGroups::WordGroups(const Descriptors& words) : centres_(MakeCentres(words)) {
  std::vector<NearestTwo> nearest(words.rows);
  centres_.FindNearest(words, 0, words.rows, nearest.data());
  std::vector<std::vector<std::uint32_t>> members(centres_.rows());
  for (std::uint32_t w = 0; w < words.rows; ++w) members[nearest[w].index].push_back(w);
  for (std::vector<std::uint32_t>& group : members) {
    PackedDescriptors packed(SelectRows(words, group));
    groups_.push_back({std::move(group), std::move(packed)});
  }
}

std::vector<std::uint32_t> WordGroups::NearestGroups(std::span<const float> distances,
                                                     std::size_t wanted) const {
  std::vector<float> sorted(distances.begin(), distances.end());
  const std::size_t last = std::min(kLookedInto, sorted.size()) - 1;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(last),
                   sorted.end());
  std::vector<std::uint32_t> groups;
  std::size_t words = 0;
  for (std::uint32_t g = 0; g < distances.size(); ++g) {
    if (distances[g] > sorted[last]) continue;
    groups.push_back(g);
    words += groups_[g].words.size();
  }
  if (words < wanted) {  // rare
    groups.resize(distances.size());
    std::iota(groups.begin(), groups.end(), 0U);
  }
  return groups;
}

void WordGroups::FindNearest(const Descriptors& descriptors, std::size_t first, std::size_t count,
                             std::size_t wanted, NearWord* nearest) const {
  std::fill_n(
      nearest, count * wanted,
      NearWord{std::numeric_limits<std::uint32_t>::max(), std::numeric_limits<float>::infinity()});
  std::vector<float> distances(count * groups_.size());
  centres_.DistancesByProduct(descriptors, first, count, distances.data());
  std::vector<std::vector<std::uint32_t>> rows_of(groups_.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto of_row = std::span(distances).subspan(i * groups_.size(), groups_.size());
    for (const std::uint32_t g : NearestGroups(of_row, wanted)) {
      rows_of[g].push_back(static_cast<std::uint32_t>(first + i));
    }
  }
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    const std::size_t words = group.words.size();
    if (rows_of[g].empty() || words == 0) continue;
    distances.resize(std::max(distances.size(), rows_of[g].size() * words));
    const Descriptors rows = SelectRows(descriptors, rows_of[g]);
    group.packed.DistancesByProduct(rows, 0, rows.rows, distances.data());
    for (std::size_t i = 0; i < rows.rows; ++i) {
      const std::span<NearWord> kept(nearest + (rows_of[g][i] - first) * wanted, wanted);
      const float* row = distances.data() + i * words;
      for (std::size_t w = 0; w < words; ++w) {
        if (row[w] <= kept.back().distance) Offer({group.words[w], row[w]}, kept);
      }
    }
  }
  if (centres_.kind() != DescriptorKind::kFloat) return;
  for (std::size_t i = 0; i < count * wanted; ++i) {
    nearest[i].distance = std::sqrt(nearest[i].distance);
  }
}

}  // namespace pliant
