// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/quantizer.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"

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

// The nearest words in order, of equally near ones the lowest first. Hardly any word gets past the
// first comparison, so that one pass over the distances is all.
void KeepNearest(std::span<const float> distances, std::span<NearWord> nearest) {
  std::size_t kept = 0;
  for (std::uint32_t w = 0; w < distances.size(); ++w) {
    const float distance = distances[w];
    if (kept == nearest.size() && !(distance < nearest[kept - 1].distance)) continue;
    std::size_t at = kept < nearest.size() ? kept++ : kept - 1;
    for (; at > 0 && distance < nearest[at - 1].distance; --at) nearest[at] = nearest[at - 1];
    nearest[at] = {w, distance};
  }
}

}  // namespace

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
  std::vector<NearWord> nearest(descriptors.rows * wanted);
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
      KeepNearest(std::span(distances).subspan(i * k, k),
                  std::span(nearest).subspan((first + i) * wanted, wanted));
    }
  });
  return nearest;
}

Bow Quantizer::BowOf(const Descriptors& descriptors, std::size_t first,
                     std::span<const std::uint32_t> words) const {
  Bow bow = MakeBow({words.begin(), words.end()});
  if (coder_) AddCodes(descriptors, first, words, &bow);
  return bow;
}

void Quantizer::AddCodes(const Descriptors& descriptors, std::size_t first,
                         std::span<const std::uint32_t> words, Bow* bow) const {
  std::vector<std::uint32_t> order(words.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return words[a] < words[b]; });
  bow->codes.resize(words.size() * coder_->code_bytes());
  std::uint8_t* code = bow->codes.data();
  for (const std::uint32_t row : order) {
    coder_->Encode(descriptors, first + row, words[row], code);
    code += coder_->code_bytes();
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
