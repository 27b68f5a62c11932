// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/residual_codes.h"

#include <algorithm>
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

// Eight parts of a vector at once. Vectors, words and centroids lie component by component of their
// part: component d of part p is at d * lanes + p. Parts beyond the last are zeros.
constexpr std::size_t kWidth = 8;
using Floats [[gnu::vector_size(4 * kWidth)]] = float;
using Numbers [[gnu::vector_size(4 * kWidth)]] = std::int32_t;
// As they lie in a vector of floats.
using Stored [[gnu::vector_size(4 * kWidth), gnu::aligned(4), gnu::may_alias]] = float;

template <std::size_t kVectors>
[[gnu::always_inline]] inline void RotateSome(const float* columns, std::size_t stride,
                                              std::span<const float> vector, float* rotated) {
  Floats sums[kVectors] = {};
  for (std::size_t d = 0; d < vector.size(); ++d, columns += stride) {
    for (std::size_t v = 0; v < kVectors; ++v)
      sums[v] += vector[d] * reinterpret_cast<const Stored*>(columns)[v];
  }
  std::memcpy(rotated, sums, sizeof(sums));
}

// columns: vector.size() rows of `size` values, a multiple of kWidth.
[[gnu::always_inline]] inline void RotateInto(const float* columns, std::size_t size,
                                              std::span<const float> vector, float* rotated) {
  constexpr std::size_t kAtOnce = 8;  // as many sums as registers hold
  std::size_t i = 0;
  for (; i + kAtOnce * kWidth <= size; i += kAtOnce * kWidth) {
    RotateSome<kAtOnce>(columns + i, size, vector, rotated + i);
  }
  for (; i < size; i += kWidth) RotateSome<1>(columns + i, size, vector, rotated + i);
}

// kPartDim: the compiler makes better code of what it knows; 0: any.
template <std::size_t kPartDim>
[[gnu::always_inline]] inline void FindSomeCentroids(const float* residual, const float* centroids,
                                                     std::size_t lanes, std::size_t part_dim,
                                                     std::int32_t* nearest) {
  if constexpr (kPartDim != 0) part_dim = kPartDim;
  for (std::size_t p = 0; p < lanes; p += kWidth) {
    Numbers best = {};
    Floats least = Floats{} + std::numeric_limits<float>::infinity();
    const float* of_centroid = centroids + p;
    for (int c = 0; c < static_cast<int>(kCentroids); ++c) {
      Floats distance = {};
      for (std::size_t d = 0; d < part_dim; ++d, of_centroid += lanes) {
        const Floats difference = *reinterpret_cast<const Stored*>(residual + d * lanes + p) -
                                  *reinterpret_cast<const Stored*>(of_centroid);
        distance += difference * difference;
      }
      const Numbers nearer = distance < least;
      best = nearer ? Numbers{} + c : best;
      least = nearer ? distance : least;
    }
    std::memcpy(nearest + p, &best, sizeof(best));
  }
}

// The nearest centroid of each part: nearest[p], p < lanes. The first of equally near ones.
[[gnu::always_inline]] inline void FindCentroids(const float* residual, const float* centroids,
                                                 std::size_t lanes, std::size_t part_dim,
                                                 std::int32_t* nearest) {
  if (part_dim == 2) return FindSomeCentroids<2>(residual, centroids, lanes, 2, nearest);
  FindSomeCentroids<0>(residual, centroids, lanes, part_dim, nearest);
}

struct Kernels {
  void (*rotate)(const float* columns, std::size_t size, std::span<const float> vector,
                 float* rotated);
  void (*find_centroids)(const float* residual, const float* centroids, std::size_t lanes,
                         std::size_t part_dim, std::int32_t* nearest);
};

// No fused multiply-add, so that every processor of the kind computes the same codes.
#if defined(__x86_64__) && defined(__GNUC__)
__attribute__((target("avx2"))) void RotateAvx2(const float* columns, std::size_t size,
                                                std::span<const float> vector, float* rotated) {
  RotateInto(columns, size, vector, rotated);
}
__attribute__((target("avx2"))) void FindCentroidsAvx2(const float* residual,
                                                       const float* centroids, std::size_t lanes,
                                                       std::size_t part_dim,
                                                       std::int32_t* nearest) {
  FindCentroids(residual, centroids, lanes, part_dim, nearest);
}
#endif

const Kernels& ChosenKernels() {
  static const Kernels chosen = []() -> Kernels {
#if defined(__x86_64__) && defined(__GNUC__)
    if (__builtin_cpu_supports("avx2") != 0) return {RotateAvx2, FindCentroidsAvx2};
#endif
    return {RotateInto, FindCentroids};
  }();
  return chosen;
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
  const Codebook& book = vocabulary_->codebook;
  const auto part_dim = static_cast<std::size_t>(book.part_dim);
  const auto dim = static_cast<std::size_t>(vocabulary_->words.dim);
  lanes_ = (book.parts() + kWidth - 1) / kWidth * kWidth;
  size_ = lanes_ * part_dim;
  columns_.resize(dim * size_);
  centroids_.resize(kCentroids * size_);
  for (std::size_t p = 0; p < book.parts(); ++p) {
    for (std::size_t d = 0; d < part_dim; ++d) {
      const std::size_t at = d * lanes_ + p;
      const float* row = book.rotation.data() + (p * part_dim + d) * dim;
      for (std::size_t i = 0; i < dim; ++i) columns_[i * size_ + at] = row[i];
      const float* of_part = book.centroids.data() + p * kCentroids * part_dim + d;
      for (std::size_t c = 0; c < kCentroids; ++c)
        centroids_[c * size_ + at] = of_part[c * part_dim];
    }
  }
  rotated_words_.resize(vocabulary_->size() * size_);
  double largest = 0;  // squared norm of a word
  for (std::size_t w = 0; w < vocabulary_->size(); ++w) {
    const auto word = vocabulary_->words.float_row(w);
    double squared = 0;
    for (const float x : word) squared += static_cast<double>(x) * x;
    largest = std::max(largest, squared);
    ChosenKernels().rotate(columns_.data(), size_, word, rotated_words_.data() + w * size_);
  }
  // b = |x'|^2 - |w|^2. Descriptors of a kind have about one norm, so b is well within twice the
  // largest; what is not is clamped.
  bias_step_ = static_cast<float>(std::max(largest, 1e-30) * 2 / 32767);
}

Codes ResidualCoder::Encode(const Descriptors& descriptors, std::span<const std::uint32_t> rows,
                            std::span<const std::uint32_t> words) const {
  Codes codes;
  codes.bytes.resize(rows.size() * code_bytes_);
  if (binary_) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      std::ranges::copy(descriptors.binary_row(rows[i]), codes.bytes.data() + i * code_bytes_);
    }
    return codes;
  }
  constexpr std::size_t kAhead = 8;  // in a large vocabulary words wait for the memory
  constexpr std::size_t kLine = 64 / sizeof(float);
  const Kernels& kernels = ChosenKernels();
  std::vector<float> residual(size_);
  std::vector<std::int32_t> nearest(lanes_);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i + kAhead < rows.size()) {
      const float* ahead = rotated_words_.data() + words[i + kAhead] * size_;
      for (std::size_t d = 0; d < size_; d += kLine) __builtin_prefetch(ahead + d);
    }
    kernels.rotate(columns_.data(), size_, descriptors.float_row(rows[i]), residual.data());
    const float* of_word = rotated_words_.data() + words[i] * size_;
    for (std::size_t d = 0; d < size_; ++d) residual[d] -= of_word[d];
    kernels.find_centroids(residual.data(), centroids_.data(), lanes_, size_ / lanes_,
                           nearest.data());
    std::uint8_t* code = codes.bytes.data() + i * code_bytes_;
    for (std::size_t j = 0; j < code_bytes_; ++j) {
      code[j] = static_cast<std::uint8_t>(nearest[2 * j] | nearest[2 * j + 1] << 4);
    }
    codes.biases.push_back(Bias(words[i], code));
  }
  return codes;
}

std::int16_t ResidualCoder::Bias(std::uint32_t word, const std::uint8_t* code) const {
  const float* of_word = rotated_words_.data() + word * size_;
  float sums[2] = {0, 0};  // of even and odd parts
  for (std::size_t first = 0; first < size_; first += lanes_) {
    for (std::size_t j = 0; j < code_bytes_; ++j) {
      const std::size_t p = first + 2 * j;
      const float even = centroids_[(code[j] & 15U) * size_ + p];
      const float odd = centroids_[(code[j] >> 4U) * size_ + p + 1];
      sums[0] += even * (even + 2 * of_word[p]);
      sums[1] += odd * (odd + 2 * of_word[p + 1]);
    }
  }
  const float bias = (sums[0] + sums[1]) / bias_step_;
  return static_cast<std::int16_t>(std::lround(std::clamp(bias, -32767.0F, 32767.0F)));
}

LookupTable ResidualCoder::TableOf(std::span<const float> query) const {
  const Codebook& book = vocabulary_->codebook;
  const std::size_t parts = book.parts();
  const auto part_dim = static_cast<std::size_t>(book.part_dim);
  std::vector<float> rotated(size_);
  ChosenKernels().rotate(columns_.data(), size_, query, rotated.data());
  std::vector<float> values(parts * kCentroids);
  std::vector<float> least(parts, std::numeric_limits<float>::infinity());
  float range = 0;
  LookupTable table;
  for (std::size_t p = 0; p < parts; ++p) {
    float most = -std::numeric_limits<float>::infinity();
    for (std::size_t c = 0; c < kCentroids; ++c) {
      const float* centroid = book.centroids.data() + (p * kCentroids + c) * part_dim;
      float dot = 0;
      for (std::size_t d = 0; d < part_dim; ++d) dot += centroid[d] * rotated[d * lanes_ + p];
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
