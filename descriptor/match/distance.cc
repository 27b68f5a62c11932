// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <string>

#include "descriptor/base/error.h"
#include "descriptor/match/distance_kernels.h"

namespace pliant {
namespace {

using kernels::BestKernels;
using kernels::kScanRows;

constexpr std::size_t kPanel = PackedDescriptors::kPanel;
static_assert(kPanel == kernels::kPanel);
constexpr float kInfinity = std::numeric_limits<float>::infinity();

std::size_t WordsOf(int bytes) { return (static_cast<std::size_t>(bytes) + 7) / 8; }

// Binary rows as whole 64-bit words, the last one filled up with zeros.
std::vector<std::uint64_t> PackBits(const Descriptors& d, std::size_t first, std::size_t count) {
  const std::size_t words = WordsOf(d.dim);
  std::vector<std::uint64_t> bits(count * words, 0);
  for (std::size_t r = 0; r < count; ++r) {
    std::memcpy(bits.data() + r * words, d.bytes.data() + (first + r) * d.dim, d.dim);
  }
  return bits;
}

}  // namespace

void CheckDescriptors(const Descriptors& d, const char* what) {
  const bool is_float = d.kind == DescriptorKind::kFloat;
  const std::size_t have = is_float ? d.floats.size() : d.bytes.size();
  if (d.dim < 1 || have != d.rows * static_cast<std::size_t>(d.dim)) {
    throw Error(ErrorCode::kInvalidArgument, "descriptors_malformed",
                std::string(what) + ": " + std::to_string(d.rows) + " rows of " +
                    std::to_string(d.dim) + " components do not make the " + std::to_string(have) +
                    " values given.");
  }
  if (!is_float) return;
  for (std::size_t i = 0; i < d.floats.size(); ++i) {
    if (std::isfinite(d.floats[i])) continue;
    throw Error(ErrorCode::kInvalidArgument, "descriptors_not_finite",
                std::string(what) + ": row " + std::to_string(i / d.dim) +
                    " has a component that is not a finite number; leave such rows out.");
  }
}

Descriptors SelectRows(const Descriptors& from, std::span<const std::uint32_t> rows) {
  const auto width = static_cast<std::size_t>(from.dim);
  auto out = Descriptors::Of(from.kind, rows.size(), from.dim);
  const auto copy = [&](const auto& values, auto& selected) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      std::copy_n(values.data() + rows[i] * width, width, selected.data() + i * width);
    }
  };
  if (from.kind == DescriptorKind::kFloat) {
    copy(from.floats, out.floats);
  } else {
    copy(from.bytes, out.bytes);
  }
  return out;
}

void PackedDescriptors::AlignedDelete::operator()(float* p) const {
  ::operator delete[](p, std::align_val_t{64});
}

PackedDescriptors::PackedDescriptors(const Descriptors& d)
    : kind_(d.kind), dim_(d.dim), rows_(d.rows) {
  if (kind_ == DescriptorKind::kBinary) {
    words_ = WordsOf(dim_);
    bits_ = PackBits(d, 0, rows_);
    return;
  }
  const std::size_t panels = (rows_ + kPanel - 1) / kPanel;
  const std::size_t size = panels * kPanel * dim_;
  panels_.reset(new (std::align_val_t{64}) float[size]());
  for (std::size_t j = 0; j < rows_; ++j) {
    float* panel = panels_.get() + (j / kPanel) * kPanel * dim_ + j % kPanel;
    const float* row = d.floats.data() + j * dim_;
    for (int p = 0; p < dim_; ++p) panel[p * kPanel] = row[p];
  }
  squared_norms_.assign(panels * kPanel, kInfinity);  // padding is never near anything
  BestKernels().squared_norms(d.floats.data(), rows_, dim_, squared_norms_.data());
}

std::function<void(std::size_t, std::size_t, std::size_t, float*)> PackedDescriptors::TilesOf(
    const Descriptors& queries, std::size_t first, std::size_t count, bool by_product) const {
  kernels::CheckQueries(queries.kind == kind_ && queries.dim == dim_, queries.dim, dim_, first,
                        count, queries.rows);
  const kernels::Kernels& kernel = BestKernels();
  if (kind_ == DescriptorKind::kBinary) {
    return [=, this, bits = PackBits(queries, first, count)](std::size_t r0, std::size_t block,
                                                             std::size_t j0, float* tile) {
      const std::size_t columns = std::min(kPanel, rows_ - j0);
      if (columns < kPanel) std::fill_n(tile, block * kPanel, kInfinity);
      kernel.hamming_tile(bits.data() + r0 * words_, block, words_, bits_.data() + j0 * words_,
                          columns, tile);
    };
  }
  const float* rows = queries.floats.data() + first * dim_;
  if (!by_product) {
    return [=, this](std::size_t r0, std::size_t block, std::size_t j0, float* tile) {
      kernel.squared_distance_tile(rows + r0 * dim_, block, dim_, panels_.get() + j0 * dim_, tile);
    };
  }
  return [=, this, norms = std::array<float, kScanRows>()](std::size_t r0, std::size_t block,
                                                           std::size_t j0, float* tile) mutable {
    const float* a = rows + r0 * dim_;
    if (j0 == 0) kernel.squared_norms(a, block, dim_, norms.data());
    kernel.dot_tile(a, block, dim_, panels_.get() + j0 * dim_, tile);
    kernel.dots_to_squared(tile, block, norms.data(), squared_norms_.data() + j0);
  };
}

void PackedDescriptors::Distances(const Descriptors& queries, std::size_t first, std::size_t count,
                                  float* out) const {
  AllDistances(queries, first, count, /*by_product=*/false, out);
}

void PackedDescriptors::DistancesByProduct(const Descriptors& queries, std::size_t first,
                                           std::size_t count, float* out) const {
  AllDistances(queries, first, count, /*by_product=*/true, out);
}

void PackedDescriptors::AllDistances(const Descriptors& queries, std::size_t first,
                                     std::size_t count, bool by_product, float* out) const {
  const kernels::FillTile fill_tile = TilesOf(queries, first, count, by_product);
  const bool root = kind_ == DescriptorKind::kFloat && !by_product;
  alignas(64) float tile[kScanRows * kPanel];
  for (std::size_t r0 = 0; r0 < count; r0 += kScanRows) {
    const std::size_t block = std::min(kScanRows, count - r0);
    for (std::size_t j0 = 0; j0 < rows_; j0 += kPanel) {
      fill_tile(r0, block, j0, tile);
      for (std::size_t r = 0; r < block; ++r) {
        const std::span row(tile + r * kPanel, std::min(kPanel, rows_ - j0));
        std::transform(row.begin(), row.end(), out + (r0 + r) * rows_ + j0,
                       [root](float value) { return root ? std::sqrt(value) : value; });
      }
    }
  }
}

void PackedDescriptors::FindNearest(const Descriptors& queries, std::size_t first,
                                    std::size_t count, NearestTwo* nearest,
                                    NearestOne* nearest_query) const {
  kernels::ScanForNearest(first, count, rows_, kind_ == DescriptorKind::kFloat,
                          TilesOf(queries, first, count, /*by_product=*/true), nearest,
                          nearest_query);
}

}  // namespace pliant
