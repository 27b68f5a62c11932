// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/residual_codes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "descriptor/base/error.h"

namespace pliant {
namespace {

constexpr std::size_t kCentroids = 16;
constexpr float kLargestEntry = 255;

[[noreturn]] void ThrowMalformed(const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, "codebook_malformed",
              "The codebook of the vocabulary " + what + "; train a new vocabulary.");
}

bool AllFinite(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

std::size_t NearestCentroid(const float* part, const float* centroids, std::size_t part_dim) {
  std::size_t best = 0;
  float least = std::numeric_limits<float>::infinity();
  for (std::size_t c = 0; c < kCentroids; ++c) {
    float distance = 0;
    for (std::size_t d = 0; d < part_dim; ++d) {
      const float difference = part[d] - centroids[c * part_dim + d];
      distance += difference * difference;
    }
    if (distance < least) {
      least = distance;
      best = c;
    }
  }
  return best;
}

// Centroid number of part p: the even part in the low half of the byte.
std::size_t Nibble(const std::uint8_t* code, std::size_t p) {
  return p % 2 == 0 ? code[p / 2] & 15U : code[p / 2] >> 4U;
}

}  // namespace

void CheckCodebook(const Codebook& codebook, const Descriptors& words) {
  if (codebook.empty()) return;
  if (words.kind == DescriptorKind::kBinary) {
    if (codebook.code_bytes != words.dim) ThrowMalformed("does not fit its words");
    return;
  }
  if (codebook.code_bytes < 0 || codebook.code_bytes > 128 || codebook.part_dim < 1 ||
      codebook.padded_dim() < static_cast<std::size_t>(words.dim)) {
    ThrowMalformed("does not fit its words");
  }
  const auto dim = static_cast<std::size_t>(words.dim);
  if (codebook.rotation.size() != codebook.padded_dim() * dim ||
      codebook.centroids.size() != codebook.padded_dim() * kCentroids) {
    ThrowMalformed("has another size than it says");
  }
  if (!AllFinite(codebook.rotation) || !AllFinite(codebook.centroids)) {
    ThrowMalformed("has values that are not finite");
  }
}

ResidualCoder::ResidualCoder(std::shared_ptr<const Vocabulary> vocabulary)
    : vocabulary_(std::move(vocabulary)),
      binary_(vocabulary_->words.kind == DescriptorKind::kBinary),
      code_bytes_(static_cast<std::size_t>(vocabulary_->codebook.code_bytes)) {
  if (vocabulary_->codebook.empty()) ThrowMalformed("is missing");
  CheckCodebook(vocabulary_->codebook, vocabulary_->words);
  if (binary_) return;
  CopyRotation();
  double largest = 0;  // squared norm of a word
  for (std::size_t w = 0; w < vocabulary_->size(); ++w) {
    const auto word = vocabulary_->words.float_row(w);
    double squared = 0;
    for (const float x : word) squared += static_cast<double>(x) * x;
    largest = std::max(largest, squared);
    const std::vector<float> rotated = Rotated(word);
    rotated_words_.insert(rotated_words_.end(), rotated.begin(), rotated.end());
  }
  // b = |x'|^2 - |w|^2. Descriptors of a kind have about one norm, so b is well within twice the
  // largest; what is not is clamped.
  bias_step_ = static_cast<float>(std::max(largest, 1e-30) * 2 / 32767);
}

void ResidualCoder::CopyRotation() {
  const Codebook& book = vocabulary_->codebook;
  const std::size_t rows = book.padded_dim();
  const auto dim = static_cast<std::size_t>(vocabulary_->words.dim);
  columns_.resize(book.rotation.size());
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t d = 0; d < dim; ++d) columns_[d * rows + r] = book.rotation[r * dim + d];
  }
}

// Column by column: all sums at once instead of one after another.
std::vector<float> ResidualCoder::Rotated(std::span<const float> vector) const {
  std::vector<float> rotated(vocabulary_->codebook.padded_dim());
  for (std::size_t d = 0; d < vector.size(); ++d) {
    const float* column = columns_.data() + d * rotated.size();
    const float x = vector[d];
    for (std::size_t r = 0; r < rotated.size(); ++r) rotated[r] += column[r] * x;
  }
  return rotated;
}

void ResidualCoder::Encode(const Descriptors& descriptors, std::size_t row, std::uint32_t word,
                           std::uint8_t* code) const {
  if (binary_) {
    const auto bytes = descriptors.binary_row(row);
    std::copy(bytes.begin(), bytes.end(), code);
    return;
  }
  const Codebook& book = vocabulary_->codebook;
  std::vector<float> residual = Rotated(descriptors.float_row(row));
  const float* of_word = rotated_words_.data() + word * residual.size();
  for (std::size_t d = 0; d < residual.size(); ++d) residual[d] -= of_word[d];
  const auto part_dim = static_cast<std::size_t>(book.part_dim);
  std::fill_n(code, code_bytes_, std::uint8_t{0});
  for (std::size_t p = 0; p < book.parts(); ++p) {
    const std::size_t nearest =
        NearestCentroid(residual.data() + p * part_dim,
                        book.centroids.data() + p * kCentroids * part_dim, part_dim);
    code[p / 2] |= static_cast<std::uint8_t>(p % 2 == 0 ? nearest : nearest << 4U);
  }
}

std::int16_t ResidualCoder::Bias(std::uint32_t word, const std::uint8_t* code) const {
  if (binary_) return 0;
  const Codebook& book = vocabulary_->codebook;
  const auto part_dim = static_cast<std::size_t>(book.part_dim);
  const float* of_word = rotated_words_.data() + word * book.padded_dim();
  float bias = 0;
  for (std::size_t p = 0; p < book.parts(); ++p) {
    const float* centroid = book.centroids.data() + (p * kCentroids + Nibble(code, p)) * part_dim;
    for (std::size_t d = 0; d < part_dim; ++d) {
      bias += centroid[d] * (centroid[d] + 2 * of_word[p * part_dim + d]);
    }
  }
  return static_cast<std::int16_t>(std::lround(std::clamp(bias / bias_step_, -32767.0F, 32767.0F)));
}

LookupTable ResidualCoder::TableOf(std::span<const float> query) const {
  const Codebook& book = vocabulary_->codebook;
  const std::size_t parts = book.parts();
  const auto part_dim = static_cast<std::size_t>(book.part_dim);
  const std::vector<float> rotated = Rotated(query);
  std::vector<float> values(parts * kCentroids);
  std::vector<float> least(parts, std::numeric_limits<float>::infinity());
  float range = 0;
  LookupTable table;
  for (std::size_t p = 0; p < parts; ++p) {
    float most = -std::numeric_limits<float>::infinity();
    for (std::size_t c = 0; c < kCentroids; ++c) {
      const float* centroid = book.centroids.data() + (p * kCentroids + c) * part_dim;
      float dot = 0;
      for (std::size_t d = 0; d < part_dim; ++d) dot += centroid[d] * rotated[p * part_dim + d];
      const float value = -2 * dot;
      values[p * kCentroids + c] = value;
      least[p] = std::min(least[p], value);
      most = std::max(most, value);
    }
    range = std::max(range, most - least[p]);
    table.offset += least[p];
  }
  table.step = range / kLargestEntry;
  table.entries.resize(values.size());
  if (table.step == 0) return table;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float steps = (values[i] - least[i / kCentroids]) / table.step;
    // Rounded. No number, from sums beyond what a float holds, counts as far away.
    table.entries[i] = static_cast<std::uint8_t>(
        steps < kLargestEntry ? static_cast<int>(steps + 0.5) : static_cast<int>(kLargestEntry));
  }
  return table;
}

}  // namespace pliant
