// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Training of codebooks: optimised product quantisation.
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

constexpr int kCentroids = 16;
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
// (Ge et al., section 3.2.2): the best rotation if residuals were Gaussian.
Matrix StartRotation(const Matrix& residuals, int parts, int part_dim) {
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

// k-means of one part: columns [first, first + part_dim) of `rotated`.
class PartClustering {
 public:
  PartClustering(const Matrix& rotated, int first, int part_dim)
      : points_(rotated.middleCols(first, part_dim)) {}

  // k-means++ (Arthur and Vassilvitskii, SODA 2007).
  Matrix Seed(std::mt19937_64* random) const {
    Matrix centroids(kCentroids, points_.cols());
    centroids.row(0) = points_.row(Draw(random));
    Eigen::VectorXf least = (points_.rowwise() - centroids.row(0)).rowwise().squaredNorm();
    for (int c = 1; c < kCentroids; ++c) {
      double left = static_cast<double>((*random)() >> 11) * 0x1.0p-53 * least.cast<double>().sum();
      Eigen::Index chosen = 0;
      while (chosen + 1 < least.size() && left >= least[chosen]) left -= least[chosen++];
      centroids.row(c) = points_.row(chosen);
      least = least.cwiseMin((points_.rowwise() - centroids.row(c)).rowwise().squaredNorm());
    }
    return centroids;
  }

  // One of Lloyd's iterations; `decoded` gets each point's centroid before the update.
  void Update(Matrix* centroids, Eigen::Ref<Matrix> decoded) const {
    Matrix sums = Matrix::Zero(kCentroids, points_.cols());
    std::vector<float> counts(kCentroids, 0);
    for (Eigen::Index i = 0; i < points_.rows(); ++i) {
      Eigen::Index nearest = 0;
      (centroids->rowwise() - points_.row(i)).rowwise().squaredNorm().minCoeff(&nearest);
      decoded.row(i) = centroids->row(nearest);
      sums.row(nearest) += points_.row(i);
      ++counts[static_cast<std::size_t>(nearest)];
    }
    for (int c = 0; c < kCentroids; ++c) {
      const float count = counts[static_cast<std::size_t>(c)];
      if (count > 0) centroids->row(c) = sums.row(c) / count;
    }
  }

 private:
  Eigen::Index Draw(std::mt19937_64* random) const {
    return static_cast<Eigen::Index>((*random)() % static_cast<std::uint64_t>(points_.rows()));
  }
  Matrix points_;
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
  Matrix rotation = StartRotation(residuals, parts, book.part_dim);
  std::vector<Matrix> centroids(static_cast<std::size_t>(parts));
  Matrix decoded(residuals.rows(), residuals.cols());
  std::mt19937_64 random(options.seed);
  for (int i = 0; i < options.iterations; ++i) {
    const Matrix rotated = residuals * rotation.transpose();
    for (int p = 0; p < parts; ++p) {
      const PartClustering part(rotated, p * book.part_dim, book.part_dim);
      Matrix& mine = centroids[static_cast<std::size_t>(p)];
      if (i == 0) mine = part.Seed(&random);
      part.Update(&mine, decoded.middleCols(p * book.part_dim, book.part_dim));
    }
    if (i + 1 == options.iterations) break;
    // The rotation that brings the residuals nearest to what they decode to (orthogonal
    // Procrustes): with U S V^T of decoded^T residuals, R = U V^T.
    const Eigen::MatrixXf product = decoded.transpose() * residuals;
    const Eigen::BDCSVD<Eigen::MatrixXf> svd(product, Eigen::ComputeFullU | Eigen::ComputeFullV);
    rotation = svd.matrixU() * svd.matrixV().transpose();
  }
  const Matrix used = rotation.leftCols(samples.dim);
  book.rotation.assign(used.data(), used.data() + used.size());
  for (const Matrix& part : centroids) {
    book.centroids.insert(book.centroids.end(), part.data(), part.data() + part.size());
  }
  return book;
}

}  // namespace pliant
