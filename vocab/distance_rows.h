// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Rows of the N x N distance matrix of a sample: stored if the matrix fits in memory, otherwise
// recomputed on each access. Both give bit-identical values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "descriptor/match/distance.h"

namespace pliant {

class DistanceRows {
 public:
  // Keeps the whole matrix if it takes at most `max_matrix_bytes`. `samples` must outlive this.
  // `checkpoint` is called periodically with the fraction of the matrix that is done, from this
  // thread, and may throw to cancel.
  DistanceRows(const Descriptors& samples, std::uint64_t max_matrix_bytes, int threads,
               const std::function<void(double done)>& checkpoint);

  std::size_t size() const { return samples_.rows; }
  bool in_memory() const { return !matrix_.empty(); }

  // Rows first .. of the matrix in memory (size() floats each). Only when in_memory().
  const float* Stored(std::size_t first) const { return matrix_.data() + first * size(); }

  // Computes rows first .. first + count - 1 into `out`, count x size().
  void Compute(std::size_t first, std::size_t count, float* out) const;

  // out[i * columns.size() + j] = distance of sample rows[i] to sample columns[j].
  void Gather(std::span<const std::uint32_t> rows, std::span<const std::uint32_t> columns,
              std::vector<float>* out) const;

 private:
  const Descriptors& samples_;
  PackedDescriptors packed_;
  std::vector<float> matrix_;  // size() x size(), or empty
};

}  // namespace pliant
