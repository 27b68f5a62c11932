// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Training of codebooks.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "descriptor/base/error.h"
#include "vocab/residual_codes.h"

namespace pliant {
namespace {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr std::size_t kCentroids = 16;
constexpr std::size_t kMostSamples = 20'000;

void Check(const Descriptors& samples, std::span<const std::uint32_t> assignment,
           const CodebookOptions& options) {
  if (options.bytes < 1 || options.bytes > 128 || options.iterations < 1) {
    throw Error(ErrorCode::kInvalidArgument, "codebook_options_invalid",
                "a code must have 1 to 128 bytes and its training 1 iteration or more");
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

  std::vector<float> Centroids(int iterations, std::mt19937_64* random) const {
    std::vector<float> centroids = Seeds(random);
    for (int i = 0; i < iterations; ++i) Update(&centroids);
    return centroids;
  }

 private:
  float SquaredDistance(std::size_t i, const float* centroid) const {
    float sum = 0;
    for (std::size_t d = 0; d < dim_; ++d) {
      const float difference = points_[i * dim_ + d] - centroid[d];
      sum += difference * difference;
    }
    return sum;
  }

  // k-means++ (Arthur and Vassilvitskii, SODA 2007).
  std::vector<float> Seeds(std::mt19937_64* random) const {
    std::vector<float> centroids;
    std::vector<double> least(size_, std::numeric_limits<double>::infinity());
    std::size_t chosen = (*random)() % size_;
    for (std::size_t c = 0; c < kCentroids; ++c) {
      const float* point = points_.data() + chosen * dim_;
      centroids.insert(centroids.end(), point, point + dim_);
      for (std::size_t i = 0; i < size_; ++i) {
        least[i] = std::min<double>(least[i], SquaredDistance(i, point));
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
      std::size_t nearest = 0;
      float least = std::numeric_limits<float>::infinity();
      for (std::size_t c = 0; c < kCentroids; ++c) {
        const float distance = SquaredDistance(i, centroids->data() + c * dim_);
        if (distance < least) {
          least = distance;
          nearest = c;
        }
      }
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

Codebook TrainCodebook(const Descriptors& samples, std::span<const std::uint32_t> assignment,
                       const Descriptors& words, const CodebookOptions& options) {
  Check(samples, assignment, options);
  Codebook book;
  book.code_bytes = samples.dim;
  if (samples.kind == DescriptorKind::kBinary) return book;
  book.code_bytes = std::max(1, std::min(options.bytes, samples.dim / 2));
  const int parts = 2 * book.code_bytes;
  book.part_dim = (samples.dim + parts - 1) / parts;
  const int padded = parts * book.part_dim;
  const Matrix residuals = Residuals(samples, assignment, words, padded);
  const Matrix rotation = Rotation(residuals, parts, book.part_dim);
  const Matrix rotated = residuals * rotation.transpose();
  std::mt19937_64 random(options.seed);
  for (int p = 0; p < parts; ++p) {
    const PartClustering part(rotated, p * book.part_dim, book.part_dim);
    const std::vector<float> centroids = part.Centroids(options.iterations, &random);
    book.centroids.insert(book.centroids.end(), centroids.begin(), centroids.end());
  }
  const Matrix used = rotation.leftCols(samples.dim);
  book.rotation.assign(used.data(), used.data() + used.size());
  return book;
}

}  // namespace pliant
