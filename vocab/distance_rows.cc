// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/distance_rows.h"

#include <algorithm>

#include "descriptor/base/parallel.h"

namespace pliant {
namespace {

constexpr std::size_t kRowsATask = 64;
constexpr std::size_t kTasksACheckpoint = 16;

}  // namespace

DistanceRows::DistanceRows(const Descriptors& samples, std::uint64_t max_matrix_bytes, int threads,
                           const std::function<void(double done)>& checkpoint)
    : samples_(samples), packed_(samples) {
  const std::size_t n = size();
  if (std::uint64_t{n} * n * sizeof(float) > max_matrix_bytes) return;
  matrix_.resize(n * n);
  const std::size_t tasks = (n + kRowsATask - 1) / kRowsATask;
  for (std::size_t t0 = 0; t0 < tasks; t0 += kTasksACheckpoint) {
    ParallelFor(std::min(kTasksACheckpoint, tasks - t0), threads, [&](std::size_t t) {
      const std::size_t first = (t0 + t) * kRowsATask;
      Compute(first, std::min(kRowsATask, n - first), matrix_.data() + first * n);
    });
    checkpoint(static_cast<double>(t0) / static_cast<double>(tasks));
  }
}

void DistanceRows::Compute(std::size_t first, std::size_t count, float* out) const {
  packed_.Distances(samples_, first, count, out);
}

void DistanceRows::Gather(std::span<const std::uint32_t> rows,
                          std::span<const std::uint32_t> columns, std::vector<float>* out) const {
  out->resize(std::max(out->size(), rows.size() * columns.size()));
  if (!in_memory()) {
    const PackedDescriptors right(SelectRows(samples_, columns));
    right.Distances(SelectRows(samples_, rows), 0, rows.size(), out->data());
    return;
  }
  float* to = out->data();
  for (const std::uint32_t row : rows) {
    const float* distances = matrix_.data() + row * size();
    for (const std::uint32_t column : columns) *to++ = distances[column];
  }
}

}  // namespace pliant
