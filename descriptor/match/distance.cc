// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/distance.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <string>

#include "descriptor/base/error.h"
#include "descriptor/match/distance_kernels.h"
#include "descriptor/match/nearest_scan.h"

namespace pliant {
namespace {

using kernels::Kernels;

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
  if (from.kind == DescriptorKind::kFloat) {
    auto out = Descriptors::Float(rows.size(), from.dim);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      std::copy_n(from.floats.data() + rows[i] * width, width, out.floats.data() + i * width);
    }
    return out;
  }
  auto out = Descriptors::Binary(rows.size(), from.dim);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::copy_n(from.bytes.data() + rows[i] * width, width, out.bytes.data() + i * width);
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
  Kernels().squared_norms(d.floats.data(), rows_, dim_, squared_norms_.data());
}

void PackedDescriptors::Distances(const Descriptors& queries, std::size_t first, std::size_t count,
                                  float* out) const {
  AllDistances(queries, first, count, false, out);
}

void PackedDescriptors::DistancesByProduct(const Descriptors& queries, std::size_t first,
                                           std::size_t count, float* out) const {
  AllDistances(queries, first, count, true, out);
}

void PackedDescriptors::AllDistances(const Descriptors& queries, std::size_t first,
                                     std::size_t count, bool by_product, float* out) const {
  CheckQueries(queries.kind == kind_ && queries.dim == dim_, queries.dim, dim_, first, count,
               queries.rows);
  const bool is_float = kind_ == DescriptorKind::kFloat;
  const auto bits = is_float ? std::vector<std::uint64_t>() : PackBits(queries, first, count);
  const auto& kernel = Kernels();
  alignas(64) float tile[kScanRows * kPanel];
  float norms[kScanRows] = {};
  for (std::size_t r0 = 0; r0 < count; r0 += kScanRows) {
    const std::size_t block = std::min(kScanRows, count - r0);
    const float* a = is_float ? queries.floats.data() + (first + r0) * dim_ : nullptr;
    if (is_float && by_product) kernel.squared_norms(a, block, dim_, norms);
    for (std::size_t j0 = 0; j0 < rows_; j0 += kPanel) {
      const std::size_t columns = std::min(kPanel, rows_ - j0);
      if (is_float && by_product) {
        kernel.dot_tile(a, block, dim_, panels_.get() + j0 * dim_, tile);
        kernel.dots_to_squared(tile, block, norms, squared_norms_.data() + j0);
      } else if (is_float) {
        kernel.squared_distance_tile(a, block, dim_, panels_.get() + j0 * dim_, tile);
      } else {
        kernel.hamming_tile(bits.data() + r0 * words_, block, words_, bits_.data() + j0 * words_,
                            columns, tile);
      }
      for (std::size_t r = 0; r < block; ++r) {
        float* to = out + (r0 + r) * rows_ + j0;
        const float* from = tile + r * kPanel;
        std::copy_n(from, columns, to);
        if (!is_float || by_product) continue;
        for (std::size_t j = 0; j < columns; ++j) to[j] = std::sqrt(to[j]);
      }
    }
  }
}

void PackedDescriptors::FindNearest(const Descriptors& queries, std::size_t first,
                                    std::size_t count, NearestTwo* nearest,
                                    NearestOne* nearest_query) const {
  CheckQueries(queries.kind == kind_ && queries.dim == dim_, queries.dim, dim_, first, count,
               queries.rows);
  const bool is_float = kind_ == DescriptorKind::kFloat;
  const auto& kernel = Kernels();
  const auto bits = is_float ? std::vector<std::uint64_t>() : PackBits(queries, first, count);
  float norms[kScanRows] = {};
  const auto fill_tile = [&](std::size_t r0, std::size_t block, std::size_t j0, float* tile) {
    if (is_float) {
      const float* a = queries.floats.data() + (first + r0) * dim_;
      if (j0 == 0) kernel.squared_norms(a, block, dim_, norms);
      kernel.dot_tile(a, block, dim_, panels_.get() + j0 * dim_, tile);
      kernel.dots_to_squared(tile, block, norms, squared_norms_.data() + j0);
    } else {
      std::fill_n(tile, block * kPanel, kInfinity);
      kernel.hamming_tile(bits.data() + r0 * words_, block, words_, bits_.data() + j0 * words_,
                          std::min(kPanel, rows_ - j0), tile);
    }
  };
  ScanForNearest(first, count, rows_, is_float, fill_tile, nearest, nearest_query);
}

}  // namespace pliant
