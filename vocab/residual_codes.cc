// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/residual_codes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "vocab/row_coding.h"

namespace pliant {
namespace {

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

constexpr float kFactorSteps = 127;      // of the rotation's largest factor
constexpr float kCentroidSteps = 511;    // of the centroids' largest component
constexpr float kCentroidUnit = 16;      // below it is the number of the centroid
constexpr float kWordSteps = 32767 / 2;  // of the largest norm of a word
constexpr float kLargestHalf = 0x1p26F;  // of a norm; only hostile codebooks reach it

// Rows of `columns` values.
Eigen::Map<const Matrix> AsMatrix(const std::vector<float>& values, std::size_t columns) {
  return {values.data(), static_cast<Eigen::Index>(values.size() / columns),
          static_cast<Eigen::Index>(columns)};
}

std::size_t RoundedUp(std::size_t value, std::size_t to) { return (value + to - 1) / to * to; }

float LargestMagnitude(const std::vector<float>& values) {
  float largest = 0;
  for (const float value : values) largest = std::max(largest, std::abs(value));
  return std::max(largest, 1e-30F);
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
  tables_.lanes = RoundedUp(book.parts(), kLanesAtOnce);
  tables_.outputs = tables_.lanes * RoundedUp(static_cast<std::size_t>(book.part_dim), 2);
  SetRotation();
  // b = |x'|^2 - |w|^2. Descriptors of a kind have about one norm, so b is well within twice the
  // largest; what is not is clamped.
  const Descriptors& words = vocabulary_->words;
  double largest = 1e-30;  // squared norm of a word
  for (std::size_t w = 0; w < words.rows; ++w) {
    const auto word = words.float_row(w);
    largest = std::max(largest, std::inner_product(word.begin(), word.end(), word.begin(), 0.0));
  }
  bias_step_ = static_cast<float>(largest * 2 / 32767);
  unit_ = static_cast<float>(std::sqrt(largest)) / kWordSteps;
  SetCentroids();
  words_.resize(words.rows * tables_.outputs);
  constexpr std::size_t kAtOnce = 1024;
  ParallelFor((words.rows + kAtOnce - 1) / kAtOnce, 0, [&](std::size_t block) {
    const std::size_t first = block * kAtOnce;
    const auto rows = static_cast<Eigen::Index>(std::min(kAtOnce, words.rows - first));
    const Eigen::Map<const Matrix> some(words.float_row(first).data(), rows, words.dim);
    const Matrix rotated =
        some * AsMatrix(rotation_, static_cast<std::size_t>(words.dim)).transpose() / unit_;
    for (Eigen::Index i = 0; i < rows; ++i) {
      std::int16_t* word = words_.data() + (first + static_cast<std::size_t>(i)) * tables_.outputs;
      for (std::size_t r = 0; r < book.padded_dim(); ++r) {
        word[Output(r)] = ToFixed(rotated(i, static_cast<Eigen::Index>(r)));
      }
    }
  });
}

std::size_t ResidualCoder::Output(std::size_t component) const {
  const auto part_dim = static_cast<std::size_t>(vocabulary_->codebook.part_dim);
  const std::size_t d = component % part_dim;
  return (d / 2 * tables_.lanes + component / part_dim) * 2 + d % 2;
}

// The factors are rounded to 8 bits. Words and queries are rotated by the rounded ones, too.
void ResidualCoder::SetRotation() {
  const Codebook& book = vocabulary_->codebook;
  const auto dim = static_cast<std::size_t>(vocabulary_->words.dim);
  const std::size_t components = CodedComponents(vocabulary_->words.dim);
  const CodingRotation coding(components);
  std::vector<float> factors(book.padded_dim() * components, 0);  // of coded rows
  for (std::size_t r = 0; r < book.padded_dim(); ++r) {
    const std::span<float> row = std::span(factors).subspan(r * components, components);
    std::copy_n(book.rotation.data() + r * dim, dim, row.begin());
    coding.Forward(row);
  }
  rotation_step_ = LargestMagnitude(factors) / kFactorSteps;
  tables_.bytes = components / 2;
  tables_.pairs = RoundedUp(tables_.bytes, kPairsAtOnce);
  tables_.rotation.resize(2 * tables_.pairs * tables_.outputs);
  tables_.middles.resize(tables_.outputs);
  rotation_.resize(book.rotation.size());
  for (std::size_t r = 0; r < book.padded_dim(); ++r) {
    const std::span<float> row = std::span(factors).subspan(r * components, components);
    const std::size_t output = Output(r);
    for (std::size_t i = 0; i < components; ++i) {
      const float steps = std::round(row[i] / rotation_step_);
      row[i] = steps * rotation_step_;
      const auto factor = static_cast<std::int8_t>(steps);
      tables_.rotation[2 * (i / 2 * tables_.outputs + output) + i % 2] = factor;
      tables_.middles[output] += static_cast<std::int32_t>(2 * CodedRow::kMiddleLevel) * factor;
    }
    coding.Back(row);
    std::copy_n(row.begin(), dim, rotation_.data() + r * dim);
  }
}

void ResidualCoder::SetCentroids() {
  const Codebook& book = vocabulary_->codebook;
  const auto part_dim = static_cast<std::size_t>(book.part_dim);
  const float step = LargestMagnitude(book.centroids) / kCentroidSteps;
  tables_.centroids.resize(kCentroids * tables_.outputs);
  tables_.norms.resize(kCentroids * tables_.lanes);
  for (std::size_t c = 0; c < kCentroids; ++c) {
    for (std::size_t p = 0; p < tables_.lanes; ++p) {
      float squared = 0;
      for (std::size_t d = 0; p < book.parts() && d < part_dim; ++d) {
        const float steps = std::round(book.centroids[(p * kCentroids + c) * part_dim + d] / step);
        squared += steps * steps;
        tables_.centroids[c * tables_.outputs + Output(p * part_dim + d)] =
            static_cast<std::int16_t>(steps * kCentroidUnit);
      }
      const float half = std::min(kLargestHalf - 1, std::round(squared * step / unit_ / 2));
      tables_.norms[c * tables_.lanes + p] =
          static_cast<std::int32_t>(half * kCentroidUnit) + static_cast<std::int32_t>(c);
    }
  }
  bias_factor_ = 2 * step * unit_ / kCentroidUnit / bias_step_;
}

Codes ResidualCoder::Encode(const CodedDescriptors& descriptors,
                            std::span<const std::uint32_t> rows,
                            std::span<const std::uint32_t> words) const {
  Codes codes;
  codes.bytes.resize(rows.size() * code_bytes_);
  std::uint8_t* code = codes.bytes.data();
  if (binary_) {
    for (const std::uint32_t row : rows) {
      code = std::copy_n(descriptors.bytes.data() + row * code_bytes_, code_bytes_, code);
    }
    return codes;
  }
  constexpr std::size_t kAhead = 8;  // in a large vocabulary words wait for the memory
  constexpr std::size_t kLine = 64 / sizeof(std::int16_t);
  RowScratch scratch(tables_);
  codes.biases.reserve(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i, code += code_bytes_) {
    if (i + kAhead < rows.size()) {
      const std::int16_t* ahead = Word(words[i + kAhead]);
      for (std::size_t d = 0; d < tables_.outputs; d += kLine) __builtin_prefetch(ahead + d);
    }
    const CodedRow row = ReadCodedRow(descriptors, rows[i]);
    const float bias =
        static_cast<float>(CodeRow(tables_, row.levels, row.scale * rotation_step_ / unit_ / 2,
                                   Word(words[i]), &scratch)) *
        bias_factor_;
    codes.biases.push_back(ToFixed(bias));
    for (std::size_t j = 0; j < code_bytes_; ++j) {
      code[j] = static_cast<std::uint8_t>(scratch.nearest[2 * j] | scratch.nearest[2 * j + 1] << 4);
    }
  }
  return codes;
}

LookupTable ResidualCoder::TableOf(std::span<const float> query) const {
  const Codebook& book = vocabulary_->codebook;
  const std::size_t parts = book.parts();
  const auto part_dim = static_cast<std::size_t>(book.part_dim);
  const Eigen::VectorXf rotated =
      AsMatrix(rotation_, query.size()) *
      Eigen::Map<const Eigen::VectorXf>(query.data(), static_cast<Eigen::Index>(query.size()));
  std::vector<float> values(parts * kCentroids);
  std::vector<float> least(parts, std::numeric_limits<float>::infinity());
  float range = 0;
  LookupTable table;
  for (std::size_t p = 0; p < parts; ++p) {
    float most = -std::numeric_limits<float>::infinity();
    for (std::size_t c = 0; c < kCentroids; ++c) {
      const float* centroid = book.centroids.data() + (p * kCentroids + c) * part_dim;
      float dot = 0;
      for (std::size_t d = 0; d < part_dim; ++d) {
        dot += centroid[d] * rotated[static_cast<Eigen::Index>(p * part_dim + d)];
      }
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
