// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/residual_codes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"

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

float SquaredDistance(const float* a, const float* b, std::size_t dim) {
  float sum = 0;
  for (std::size_t d = 0; d < dim; ++d) {
    const float difference = a[d] - b[d];
    sum += difference * difference;
  }
  return sum;
}

std::size_t NearestCentroid(const float* part, const float* centroids, std::size_t part_dim) {
  std::size_t best = 0;
  float least = std::numeric_limits<float>::infinity();
  for (std::size_t c = 0; c < kCentroids; ++c) {
    const float distance = SquaredDistance(part, centroids + c * part_dim, part_dim);
    if (distance < least) {
      least = distance;
      best = c;
    }
  }
  return best;
}

using OfCentroids = Eigen::Array<float, kCentroids, 1>;

// Which value is the least, without branches: a number in the last bits of each goes with it, and
// what differs in these bits only is equal. No value is negative.
std::size_t Least(OfCentroids values) {
  using Words [[gnu::vector_size(4 * kCentroids)]] = std::uint32_t;
  constexpr std::uint32_t kNumber = kCentroids - 1;
  constexpr Words kNumbers = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  Words words;
  std::memcpy(&words, values.data(), sizeof(words));
  words = (words & ~kNumber) | kNumbers;
  std::memcpy(values.data(), &words, sizeof(words));
  return std::bit_cast<std::uint32_t>(values.minCoeff()) & kNumber;
}

// Centroid number of part p: the even part in the low half of the byte.
std::size_t Nibble(const std::uint8_t* code, std::size_t p) {
  return p % 2 == 0 ? code[p / 2] & 15U : code[p / 2] >> 4U;
}

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr std::size_t kMostSamples = 20'000;

void Check(const Descriptors& samples, std::span<const std::uint32_t> assignment, int bytes) {
  if (bytes < 1 || bytes > 128) {
    throw Error(ErrorCode::kInvalidArgument, "code_bytes_invalid",
                "A code must have 1 to 128 bytes.");
  }
  if (samples.rows == 0 || assignment.size() != samples.rows) {
    throw Error(ErrorCode::kInvalidArgument, "no_samples",
                "A codebook cannot be trained without samples and their words.");
  }
}

// Residuals of at most kMostSamples samples, evenly spaced, as rows; zeros fill up to `padded`.
Matrix Residuals(const Descriptors& samples, std::span<const std::uint32_t> assignment,
                 const Descriptors& words, int padded) {
  const std::size_t count = std::min(samples.rows, kMostSamples);
  Matrix residuals = Matrix::Zero(static_cast<Eigen::Index>(count), padded);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t row = i * samples.rows / count;
    const auto x = samples.float_row(row);
    const auto w = words.float_row(assignment[row]);
    for (std::size_t d = 0; d < x.size(); ++d) {
      residuals(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(d)) = x[d] - w[d];
    }
  }
  return residuals;
}

// Rows are the principal directions, dealt out so that the parts' products of variances are even
// (Ge et al., "parametric solution": the best rotation if residuals are Gaussian). Updating the
// rotation by what it decodes to, their other solution, gained nothing on DEAL's and SIFT's.
Matrix Rotation(const Matrix& residuals, int parts, int part_dim) {
  const Eigen::MatrixXf covariance = residuals.transpose() * residuals;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXf> solver(covariance);
  const Eigen::Index dim = residuals.cols();
  std::vector<double> product(static_cast<std::size_t>(parts), 0);  // logarithm
  std::vector<int> filled(static_cast<std::size_t>(parts), 0);
  Matrix rotation(dim, dim);
  for (Eigen::Index k = dim - 1; k >= 0; --k) {  // eigenvalues come in ascending order
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t p = 0; p < product.size(); ++p) {
      if (filled[p] < part_dim && product[p] < least) {
        least = product[p];
        best = p;
      }
    }
    const int row = static_cast<int>(best) * part_dim + filled[best]++;
    rotation.row(row) = solver.eigenvectors().col(k).transpose();
    product[best] += std::log(std::max(1e-12F, solver.eigenvalues()[k]));
  }
  return rotation;
}

// k-means of one part: its points lie side by side, part_dim components each.
class PartClustering {
 public:
  PartClustering(const Matrix& rotated, int first, int part_dim)
      : dim_(static_cast<std::size_t>(part_dim)), size_(static_cast<std::size_t>(rotated.rows())) {
    points_.reserve(size_ * dim_);
    for (Eigen::Index i = 0; i < rotated.rows(); ++i) {
      const float* row = rotated.data() + i * rotated.cols() + first;
      points_.insert(points_.end(), row, row + dim_);
    }
  }

  std::vector<float> Centroids(std::mt19937_64* random) const {
    constexpr int kIterations = 12;
    std::vector<float> centroids = Seeds(random);
    for (int i = 0; i < kIterations; ++i) Update(&centroids);
    return centroids;
  }

 private:
  // k-means++ (Arthur and Vassilvitskii, SODA 2007).
  std::vector<float> Seeds(std::mt19937_64* random) const {
    std::vector<float> centroids;
    std::vector<double> least(size_, std::numeric_limits<double>::infinity());
    std::size_t chosen = (*random)() % size_;
    for (std::size_t c = 0; c < kCentroids; ++c) {
      const float* point = points_.data() + chosen * dim_;
      centroids.insert(centroids.end(), point, point + dim_);
      for (std::size_t i = 0; i < size_; ++i) {
        least[i] =
            std::min<double>(least[i], SquaredDistance(points_.data() + i * dim_, point, dim_));
      }
      double left = static_cast<double>((*random)() >> 11) * 0x1.0p-53 *
                    std::accumulate(least.begin(), least.end(), 0.0);
      chosen = 0;
      while (chosen + 1 < size_ && left >= least[chosen]) left -= least[chosen++];
    }
    return centroids;
  }

  // One of Lloyd's iterations. A centroid that nothing is nearest to stays where it is.
  void Update(std::vector<float>* centroids) const {
    std::vector<double> sums(kCentroids * dim_, 0);
    std::vector<double> counts(kCentroids, 0);
    for (std::size_t i = 0; i < size_; ++i) {
      const std::size_t nearest =
          NearestCentroid(points_.data() + i * dim_, centroids->data(), dim_);
      for (std::size_t d = 0; d < dim_; ++d) sums[nearest * dim_ + d] += points_[i * dim_ + d];
      ++counts[nearest];
    }
    for (std::size_t c = 0; c < kCentroids; ++c) {
      if (counts[c] == 0) continue;
      for (std::size_t d = 0; d < dim_; ++d) {
        (*centroids)[c * dim_ + d] = static_cast<float>(sums[c * dim_ + d] / counts[c]);
      }
    }
  }

  std::size_t dim_;
  std::size_t size_;
  std::vector<float> points_;
};

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
  const Codebook& book = vocabulary_->codebook;
  const auto rows = static_cast<Eigen::Index>(book.padded_dim());
  columns_.resize(book.rotation.size());
  Eigen::Map<Matrix>(columns_.data(), vocabulary_->words.dim, rows) =
      Eigen::Map<const Matrix>(book.rotation.data(), rows, vocabulary_->words.dim).transpose();
  const auto part_dim = static_cast<std::size_t>(book.part_dim);
  for (std::size_t p = 0; p < book.parts(); ++p) {
    for (std::size_t d = 0; d < part_dim; ++d) {
      for (std::size_t c = 0; c < kCentroids; ++c) {
        centroid_columns_.push_back(book.centroids[(p * kCentroids + c) * part_dim + d]);
      }
    }
  }
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

std::vector<float> ResidualCoder::Rotated(std::span<const float> vector) const {
  std::vector<float> rotated(vocabulary_->codebook.padded_dim());
  const auto rows = static_cast<Eigen::Index>(rotated.size());
  const auto dim = static_cast<Eigen::Index>(vector.size());
  Eigen::Map<Eigen::VectorXf>(rotated.data(), rows).noalias() =
      Eigen::Map<const Eigen::MatrixXf>(columns_.data(), rows, dim) *
      Eigen::Map<const Eigen::VectorXf>(vector.data(), dim);
  return rotated;
}

void ResidualCoder::Prefetch(std::uint32_t word) const {
  if (binary_) return;
  constexpr std::size_t kLine = 64 / sizeof(float);
  const std::size_t dim = vocabulary_->codebook.padded_dim();
  for (std::size_t d = 0; d < dim; d += kLine) __builtin_prefetch(&rotated_words_[word * dim + d]);
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
    const float* column = centroid_columns_.data() + p * kCentroids * part_dim;
    OfCentroids distances = OfCentroids::Zero();
    for (std::size_t d = 0; d < part_dim; ++d, column += kCentroids) {
      distances += (residual[p * part_dim + d] - Eigen::Map<const OfCentroids>(column)).square();
    }
    const std::size_t nearest = Least(distances);
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

Codebook TrainCodebook(const Descriptors& samples, std::span<const std::uint32_t> assignment,
                       const Descriptors& words, int bytes, std::uint64_t seed, int threads) {
  Check(samples, assignment, bytes);
  Codebook book;
  book.code_bytes = samples.dim;
  if (samples.kind == DescriptorKind::kBinary) return book;
  book.code_bytes = std::max(1, std::min(bytes, samples.dim / 2));
  const int parts = 2 * book.code_bytes;
  book.part_dim = (samples.dim + parts - 1) / parts;
  const int padded = parts * book.part_dim;
  const Matrix residuals = Residuals(samples, assignment, words, padded);
  const Matrix rotation = Rotation(residuals, parts, book.part_dim);
  const Matrix rotated = residuals * rotation.transpose();
  const std::size_t part_values = kCentroids * static_cast<std::size_t>(book.part_dim);
  book.centroids.resize(static_cast<std::size_t>(parts) * part_values);
  ParallelFor(static_cast<std::size_t>(parts), threads, [&](std::size_t p) {
    const PartClustering part(rotated, static_cast<int>(p) * book.part_dim, book.part_dim);
    std::mt19937_64 random(seed + p);
    std::ranges::copy(part.Centroids(&random), book.centroids.data() + p * part_values);
  });
  const Matrix used = rotation.leftCols(samples.dim);
  book.rotation.assign(used.data(), used.data() + used.size());
  return book;
}

}  // namespace pliant
