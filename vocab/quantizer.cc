// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/quantizer.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "descriptor/error.h"
#include "descriptor/parallel.h"

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

}  // namespace

Quantizer::Quantizer(std::shared_ptr<const Vocabulary> vocabulary)
    : vocabulary_(std::move(vocabulary)), words_(Checked(vocabulary_).words) {
  const Descriptors& words = vocabulary_->words;
  if (words.kind != DescriptorKind::kFloat) return;
  for (std::size_t w = 0; w < words.rows; ++w) {
    largest_squared_norm_ = std::max(largest_squared_norm_, SquaredNorm(words.float_row(w)));
  }
}

std::vector<std::uint32_t> Quantizer::Assign(const Descriptors& descriptors, int threads) const {
  if (descriptors.kind != words_.kind() || descriptors.dim != words_.dim()) {
    throw Error(ErrorCode::kConflict, "vocabulary_mismatch",
                "The descriptors differ in kind or size from the words of the vocabulary (made by "
                "model " +
                    vocabulary_->model_id + "); train a vocabulary for this descriptor.");
  }
  CheckDescriptors(descriptors, "descriptors");
  std::vector<std::uint32_t> words(descriptors.rows);
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

Bow MakeBow(std::vector<std::uint32_t> words) {
  std::sort(words.begin(), words.end());
  Bow bow;
  bow.total = static_cast<std::uint32_t>(words.size());
  for (const std::uint32_t word : words) {
    if (bow.words.empty() || bow.words.back().word != word) bow.words.push_back({word, 0});
    ++bow.words.back().count;
  }
  return bow;
}

}  // namespace pliant
