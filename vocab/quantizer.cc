// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/quantizer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "vocab/hierarchical_k_medoids.h"
#include "vocab/k_medoids.h"
#include "vocab/residual_codes.h"

namespace pliant {
namespace {

constexpr std::size_t kRowsATask = 512;

double SquaredNorm(std::span<const float> row) {
  double sum = 0;
  for (const float x : row) sum += static_cast<double>(x) * x;
  return sum;
}

const Vocabulary& Checked(const std::shared_ptr<const Vocabulary>& vocabulary) {
  if (vocabulary == nullptr || vocabulary->size() == 0) {
    throw Error(ErrorCode::kInvalidArgument, "vocabulary_empty",
                "A vocabulary without words cannot quantise; train one first.");
  }
  CheckDescriptors(vocabulary->words, "vocabulary");
  return *vocabulary;
}

// Measured on photographs; see vocab/README.md.
constexpr std::size_t kLookedInto = 40;
constexpr double kGroupsARoot = 2;        // groups for the square root of the number of words
constexpr std::size_t kClustered = 4096;  // words that k-medoids sees
constexpr std::size_t kMoving = 131072;   // words whose means the centres move to
constexpr int kMoves = 3;

bool Nearer(const NearWord& a, const NearWord& b) {
  return a.distance < b.distance || (a.distance == b.distance && a.word < b.word);
}

// What any word is nearer than.
constexpr NearWord kNone{std::numeric_limits<std::uint32_t>::max(),
                         std::numeric_limits<float>::infinity()};

// `nearest` is sorted; the farthest makes room. Hardly any word gets past the first comparison.
void Offer(NearWord word, std::span<NearWord> nearest) {
  if (!Nearer(word, nearest.back())) return;
  std::size_t at = nearest.size() - 1;
  for (; at > 0 && Nearer(word, nearest[at - 1]); --at) nearest[at] = nearest[at - 1];
  nearest[at] = word;
}

// Some of the words, by k-medoids of a part of them.
Descriptors ChooseCentres(const Descriptors& words) {
  const Descriptors sample = SelectRows(words, DrawRows(AllRows(words.rows), kClustered, 1));
  KMedoidsOptions options;
  options.k = static_cast<int>(std::min(static_cast<double>(sample.rows),
                                        kGroupsARoot * std::sqrt(static_cast<double>(words.rows))));
  options.max_passes = 1;
  return SelectRows(sample, KMedoids(sample, options).medoids);
}

std::vector<NearestTwo> NearestOf(const Descriptors& words, const PackedDescriptors& centres) {
  std::vector<NearestTwo> nearest(words.rows);
  ParallelFor((words.rows + kRowsATask - 1) / kRowsATask, 0, [&](std::size_t task) {
    const std::size_t first = task * kRowsATask;
    centres.FindNearest(words, first, std::min(kRowsATask, words.rows - first),
                        nearest.data() + first);
  });
  return nearest;
}

// Moves each centre to the mean of its words (Lloyd's iteration of k-means). Floats only.
void MoveToMeans(const Descriptors& words, Descriptors* centres) {
  const auto dim = static_cast<std::size_t>(words.dim);
  const std::vector<NearestTwo> nearest = NearestOf(words, PackedDescriptors(*centres));
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
  const Descriptors some = SelectRows(words, DrawRows(AllRows(words.rows), kMoving, 2));
  for (int i = 0; i < kMoves; ++i) MoveToMeans(some, &centres);
  return centres;
}

// `words`: ascending.
Bow Counted(std::span<const std::uint32_t> words) {
  Bow bow;
  bow.total = static_cast<std::uint32_t>(words.size());
  for (const std::uint32_t word : words) {
    if (bow.words.empty() || bow.words.back().word != word) bow.words.push_back({word, 0});
    ++bow.words.back().count;
  }
  return bow;
}

}  // namespace

WordGroups::WordGroups(const Descriptors& words) : centres_(MakeCentres(words)) {
  const std::vector<NearestTwo> nearest = NearestOf(words, centres_);
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
  std::fill_n(nearest, count * wanted, kNone);
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

Quantizer::Quantizer(std::shared_ptr<const Vocabulary> vocabulary)
    : vocabulary_(std::move(vocabulary)), words_(Checked(vocabulary_).words) {
  const Descriptors& words = vocabulary_->words;
  if (words.rows >= WordGroups::kLeastWords) groups_ = std::make_unique<WordGroups>(words);
  if (!vocabulary_->codebook.empty()) coder_ = std::make_unique<ResidualCoder>(vocabulary_);
  if (words.kind != DescriptorKind::kFloat) return;
  for (std::size_t w = 0; w < words.rows; ++w) {
    largest_squared_norm_ = std::max(largest_squared_norm_, SquaredNorm(words.float_row(w)));
  }
}

Quantizer::~Quantizer() = default;

void Quantizer::CheckFits(const Descriptors& descriptors) const {
  if (descriptors.kind != words_.kind() || descriptors.dim != words_.dim()) {
    throw Error(ErrorCode::kConflict, "vocabulary_mismatch",
                "The descriptors differ in kind or size from the words of the vocabulary (made by "
                "model " +
                    vocabulary_->model_id + "); train a vocabulary for this descriptor.");
  }
  CheckDescriptors(descriptors, "descriptors");
}

std::vector<std::uint32_t> Quantizer::Assign(const Descriptors& descriptors, int threads) const {
  CheckFits(descriptors);
  std::vector<std::uint32_t> words(descriptors.rows);
  if (groups_) {
    const std::vector<NearWord> nearest = NearestWords(descriptors, 1, threads);
    std::transform(nearest.begin(), nearest.end(), words.begin(),
                   [](const NearWord& near) { return near.word; });
    return words;
  }
  ParallelFor((words.size() + kRowsATask - 1) / kRowsATask, threads, [&](std::size_t t) {
    const std::size_t first = t * kRowsATask;
    AssignBlock(descriptors, first, std::min(kRowsATask, words.size() - first),
                words.data() + first);
  });
  return words;
}

void Quantizer::AssignBlock(const Descriptors& descriptors, std::size_t first, std::size_t count,
                            std::uint32_t* words) const {
  std::vector<NearestTwo> nearest(count);
  words_.FindNearest(descriptors, first, count, nearest.data());
  // Counted bits are exact. A computed |x|^2 + |w|^2 - 2 x.w is off by at most about dim units in
  // the last place of |x|^2 + |w|^2: words nearer to each other than twice that are undecided.
  const double error = 0.5 * std::numeric_limits<float>::epsilon() * (words_.dim() + 4);
  std::vector<std::uint32_t> undecided;
  for (std::size_t i = 0; i < count; ++i) {
    words[i] = nearest[i].index;
    if (words_.kind() != DescriptorKind::kFloat) continue;
    const double best = nearest[i].distance;
    const double second = nearest[i].second;
    const double scale = SquaredNorm(descriptors.float_row(first + i)) + largest_squared_norm_;
    if (second * second - best * best > 2 * error * scale) continue;
    undecided.push_back(static_cast<std::uint32_t>(first + i));
  }
  if (undecided.empty()) return;
  const std::size_t k = words_.rows();
  constexpr std::size_t kAtATime = 16;
  std::vector<float> distances(kAtATime * k);
  const Descriptors rows = SelectRows(descriptors, undecided);
  for (std::size_t begin = 0; begin < rows.rows; begin += kAtATime) {
    const std::size_t batch = std::min(kAtATime, rows.rows - begin);
    words_.Distances(rows, begin, batch, distances.data());
    for (std::size_t i = 0; i < batch; ++i) {
      const float* row = distances.data() + i * k;
      words[undecided[begin + i] - first] =
          static_cast<std::uint32_t>(std::min_element(row, row + k) - row);
    }
  }
}

std::vector<NearWord> Quantizer::NearestWords(const Descriptors& descriptors, int count,
                                              int threads) const {
  CheckFits(descriptors);
  if (count < 1) {
    throw Error(ErrorCode::kInvalidArgument, "bad_count", "count must be 1 or more.");
  }
  const std::size_t k = words_.rows();
  const std::size_t wanted = std::min(static_cast<std::size_t>(count), k);
  std::vector<NearWord> nearest(descriptors.rows * wanted, kNone);
  // Groups pay where many rows look into the same one.
  const auto workers = static_cast<std::size_t>(ResolveThreads(threads));
  const std::size_t share = (descriptors.rows + workers - 1) / workers;
  const std::size_t at_a_time = groups_ ? std::clamp<std::size_t>(share, 64, 1024) : 16;
  ParallelFor((descriptors.rows + at_a_time - 1) / at_a_time, threads, [&](std::size_t t) {
    const std::size_t first = t * at_a_time;
    const std::size_t rows = std::min(at_a_time, descriptors.rows - first);
    if (groups_) {
      groups_->FindNearest(descriptors, first, rows, wanted, nearest.data() + first * wanted);
      return;
    }
    std::vector<float> distances(rows * k);
    words_.Distances(descriptors, first, rows, distances.data());
    for (std::size_t i = 0; i < rows; ++i) {
      const std::span<NearWord> kept(nearest.data() + (first + i) * wanted, wanted);
      for (std::uint32_t w = 0; w < k; ++w) Offer({w, distances[i * k + w]}, kept);
    }
  });
  return nearest;
}

Bow Quantizer::BowOf(const CodedDescriptors& descriptors,
                     std::span<const std::uint32_t> words) const {
  std::vector<std::uint64_t> order(words.size());  // word, then row
  for (std::size_t i = 0; i < words.size(); ++i) order[i] = std::uint64_t{words[i]} << 32U | i;
  std::ranges::sort(order);
  std::vector<std::uint32_t> sorted(words.size());
  std::vector<std::uint32_t> rows(words.size());
  for (std::size_t i = 0; i < words.size(); ++i) {
    sorted[i] = static_cast<std::uint32_t>(order[i] >> 32U);
    rows[i] = static_cast<std::uint32_t>(order[i]);
  }
  Bow bow = Counted(sorted);
  if (!coder_) return bow;
  Codes codes = coder_->Encode(descriptors, rows, sorted);
  bow.codes = std::move(codes.bytes);
  bow.biases = std::move(codes.biases);
  return bow;
}

Bow MakeBow(std::vector<std::uint32_t> words) {
  std::ranges::sort(words);
  return Counted(words);
}

}  // namespace pliant
