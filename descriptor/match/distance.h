// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Blocked distances between many descriptors: Euclidean for floats, Hamming for bits.
//
// Every value depends on its two rows only, never on their position, their block or the number of
// threads. The distance of identical rows is exactly 0, and d(a, b) == d(b, a) bit for bit. The
// kernels use AVX-512 or AVX2 if the processor has them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "descriptor/features/features.h"

namespace pliant {

// Throws kInvalidArgument that names `what` and the row if a float of `descriptors` is NaN or
// infinite. Also throws it if the sizes in `descriptors` contradict each other.
void CheckDescriptors(const Descriptors& descriptors, const char* what);

// The named rows of `descriptors`, in that order.
Descriptors SelectRows(const Descriptors& descriptors, std::span<const std::uint32_t> rows);

// The nearest row and the distance of the second nearest.
struct NearestTwo {
  std::uint32_t index = 0;  // the lowest of equally near rows
  float distance = 0;       // Euclidean or Hamming; infinite when there is no row
  float second = 0;         // infinite when there are fewer than two rows
};

// The nearest row of the other side.
struct NearestOne {
  std::uint32_t index = 0;
  float distance = 0;
};

// Rows laid out for the kernels: the right-hand side of distance computations. Immutable and
// thread-safe. Keeps a copy; the source may be destroyed.
class PackedDescriptors {
 public:
  // Columns come in panels of this many; the last panel is padded.
  static constexpr std::size_t kPanel = 32;

  explicit PackedDescriptors(const Descriptors& descriptors);

  DescriptorKind kind() const { return kind_; }
  int dim() const { return dim_; }
  std::size_t rows() const { return rows_; }

  // out[r * rows() + j] = distance of row first + r of `queries` to packed row j, by summing
  // squared differences: exact to rounding, however near the rows are.
  void Distances(const Descriptors& queries, std::size_t first, std::size_t count,
                 float* out) const;

  // As Distances, but squared (floats), by |a|^2 + |b|^2 - 2 a.b: faster, as precise as
  // FindNearest.
  void DistancesByProduct(const Descriptors& queries, std::size_t first, std::size_t count,
                          float* out) const;

  // The two nearest packed rows for each of the rows first .. first + count - 1 of `queries`, by
  // |a|^2 + |b|^2 - 2 a.b (twice as fast as Distances; distances below about 1e-3 |a| are
  // uncertain by that amount). `nearest_query`, if not null, has rows() elements and receives the
  // nearest query row of each packed row. Queries and packed rows must be finite.
  void FindNearest(const Descriptors& queries, std::size_t first, std::size_t count,
                   NearestTwo* nearest, NearestOne* nearest_query = nullptr) const;

 private:
  // Fills tiles as kernels::FillTile describes, with squared distances of floats or the number of
  // differing bits. `queries` must outlive it.
  std::function<void(std::size_t, std::size_t, std::size_t, float*)> TilesOf(
      const Descriptors& queries, std::size_t first, std::size_t count, bool by_product) const;
  void AllDistances(const Descriptors& queries, std::size_t first, std::size_t count,
                    bool by_product, float* out) const;

  DescriptorKind kind_;
  int dim_;
  std::size_t rows_;
  std::size_t words_ = 0;  // 64-bit words per binary row
  struct AlignedDelete {
    void operator()(float* p) const;
  };
  std::unique_ptr<float[], AlignedDelete> panels_;  // kFloat: panels x dim x kPanel
  std::vector<float> squared_norms_;                // kFloat: rows, padded to whole panels
  std::vector<std::uint64_t> bits_;                 // kBinary: rows x words_
};

}  // namespace pliant
