// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/match/stepped.h"

#include <bit>
#include <cstring>
#include <limits>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "descriptor/match/distance_kernels.h"

namespace pliant {
namespace {

using kernels::kPanel;
using kernels::kStepGroup;
using kernels::StepKernels;

constexpr int kMaxComponents = 1024;  // 127 * 127 times as many is a whole number of a float

}  // namespace

// The target attributes are on the functions, as in distance_kernels.cc, and the intrinsics only in
// functions that carry them.
namespace kernels {
namespace {

#if defined(__x86_64__)

#define PLIANT_AVX2 [[gnu::target("avx2,fma")]]
#define PLIANT_VNNI [[gnu::target("avx512f,avx512vl,avx512bw,avx512dq,avx512vnni,fma")]]

// Magnitudes are compared as whole numbers, which keeps their order (and puts NaN above them all):
// such a loop the compiler vectorises.
[[gnu::always_inline]] inline std::uint32_t Magnitude(float value) {
  return std::bit_cast<std::uint32_t>(value) & 0x7fffffffU;
}

[[gnu::always_inline]] inline bool Split(const float* __restrict row, std::size_t dim,
                                         std::int8_t* __restrict steps, float* scale) {
  constexpr float kLeast = 1e-30F;
  constexpr float kMost = 1e30F;
  constexpr float kTolerance = 1e-6F;
  constexpr float kToWhole = 12582912.0F;  // 1.5 * 2^23: adding it rounds to a whole number
  std::uint32_t most = 0;
  for (std::size_t p = 0; p < dim; ++p) {
    const std::uint32_t m = Magnitude(row[p]);
    most = m > most ? m : most;
  }
  const auto largest = std::bit_cast<float>(most);
  *scale = largest / 127.0F;
  if (largest == 0) {
    std::memset(steps, 0, dim);
    return true;
  }
  if (!(largest >= kLeast && largest <= kMost)) return false;
  const float s = *scale;
  const float inverse = 127.0F / largest;
  std::uint32_t worst = 0;
  for (std::size_t p = 0; p < dim; ++p) {
    const float whole = (row[p] * inverse + kToWhole) - kToWhole;
    const std::uint32_t error = Magnitude(row[p] - whole * s);
    worst = error > worst ? error : worst;
    steps[p] = static_cast<std::int8_t>(static_cast<std::int32_t>(whole));
  }
  return std::bit_cast<float>(worst) <= kTolerance * largest;
}

PLIANT_AVX2 bool SplitAvx2(const float* row, std::size_t dim, std::int8_t* steps, float* scale) {
  return Split(row, dim, steps, scale);
}

PLIANT_VNNI bool SplitVnni(const float* row, std::size_t dim, std::int8_t* steps, float* scale) {
  return Split(row, dim, steps, scale);
}

[[gnu::always_inline]] inline std::int32_t GroupOf(const std::int8_t* steps) {
  std::int32_t group;
  std::memcpy(&group, steps, sizeof(group));
  return group;
}

// |a|^2 + |b|^2 - 2 a.b, where the norms are scale^2 times the sum of squared steps and the product
// is scale_a scale_b times the sum of products: rows with the same steps and scale are exactly 0
// apart.
template <int kRows>
PLIANT_AVX2 inline void SquaredAvx2(const StepRows& a, std::size_t first, std::size_t groups,
                                    const StepPanel& panel, float* out) {
  constexpr int kLanes = 8;
  constexpr int kVectors = kPanel / kLanes;
  const __m256i ones = _mm256_set1_epi16(1);
  __m256i sums[kRows][kVectors];
#pragma GCC unroll 2
  for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; ++v) sums[r][v] = _mm256_setzero_si256();
  }
  for (std::size_t g = 0; g < groups; ++g) {
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; ++v) {
      const __m256i b = _mm256_loadu_si256(
          reinterpret_cast<const __m256i*>(panel.steps + (g * kPanel + v * kLanes) * kStepGroup));
      const __m256i magnitude = _mm256_abs_epi8(b);
#pragma GCC unroll 2
      for (int r = 0; r < kRows; ++r) {
        // |b| times a with b's sign; two products of at most 127 * 127 fit 16 bits.
        const __m256i x =
            _mm256_set1_epi32(GroupOf(a.steps + ((first + r) * groups + g) * kStepGroup));
        const __m256i pairs = _mm256_maddubs_epi16(magnitude, _mm256_sign_epi8(x, b));
        sums[r][v] = _mm256_add_epi32(sums[r][v], _mm256_madd_epi16(pairs, ones));
      }
    }
  }
  const __m256 two = _mm256_set1_ps(2);
#pragma GCC unroll 2
  for (int r = 0; r < kRows; ++r) {
    const __m256 scale = _mm256_set1_ps(a.scales[first + r]);
    const __m256 norm = _mm256_set1_ps(a.norms[first + r]);
#pragma GCC unroll 4
    for (int v = 0; v < kVectors; ++v) {
      const __m256 factor = _mm256_mul_ps(scale, _mm256_loadu_ps(panel.scales + v * kLanes));
      const __m256 dot = _mm256_mul_ps(factor, _mm256_cvtepi32_ps(sums[r][v]));
      const __m256 both = _mm256_add_ps(norm, _mm256_loadu_ps(panel.norms + v * kLanes));
      const __m256 squared = _mm256_fnmadd_ps(two, dot, both);
      _mm256_storeu_ps(out + (first + r) * kPanel + v * kLanes,
                       _mm256_max_ps(squared, _mm256_setzero_ps()));
    }
  }
}

PLIANT_AVX2 void SquaredTileAvx2(const StepRows& a, std::size_t rows, std::size_t groups,
                                 const StepPanel& panel, float* out) {
  std::size_t r = 0;
  for (; r + 2 <= rows; r += 2) SquaredAvx2<2>(a, r, groups, panel, out);
  for (; r < rows; ++r) SquaredAvx2<1>(a, r, groups, panel, out);
}

// As SquaredAvx2. The instruction multiplies unsigned by signed bytes: the panel's steps have 128
// added, and 128 times the sum of a's steps is taken off again.
template <int kRows>
PLIANT_VNNI inline void SquaredVnni(const StepRows& a, std::size_t first, std::size_t groups,
                                    const StepPanel& panel, float* out) {
  constexpr int kLanes = 16;
  constexpr int kVectors = kPanel / kLanes;
  constexpr __mmask16 kAll = 0xffff;  // the forms without a mask make GCC 12 warn of its own header
  const __m512i bias = _mm512_set1_epi8(-128);
  __m512i sums[kRows][kVectors];
#pragma GCC unroll 8
  for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) sums[r][v] = _mm512_set1_epi32(-128 * a.sums[first + r]);
  }
  for (std::size_t g = 0; g < groups; ++g) {
    __m512i b[kVectors];
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
      b[v] = _mm512_xor_si512(
          bias, _mm512_loadu_si512(panel.steps + (g * kPanel + v * kLanes) * kStepGroup));
    }
#pragma GCC unroll 8
    for (int r = 0; r < kRows; ++r) {
      const __m512i x =
          _mm512_set1_epi32(GroupOf(a.steps + ((first + r) * groups + g) * kStepGroup));
#pragma GCC unroll 2
      for (int v = 0; v < kVectors; ++v) sums[r][v] = _mm512_dpbusd_epi32(sums[r][v], b[v], x);
    }
  }
  const __m512 two = _mm512_set1_ps(2);
#pragma GCC unroll 8
  for (int r = 0; r < kRows; ++r) {
    const __m512 scale = _mm512_set1_ps(a.scales[first + r]);
    const __m512 norm = _mm512_set1_ps(a.norms[first + r]);
#pragma GCC unroll 2
    for (int v = 0; v < kVectors; ++v) {
      const __m512 factor = _mm512_mul_ps(scale, _mm512_loadu_ps(panel.scales + v * kLanes));
      const __m512 dot = _mm512_mul_ps(factor, _mm512_maskz_cvtepi32_ps(kAll, sums[r][v]));
      const __m512 both = _mm512_add_ps(norm, _mm512_loadu_ps(panel.norms + v * kLanes));
      const __m512 squared = _mm512_fnmadd_ps(two, dot, both);
      _mm512_storeu_ps(out + (first + r) * kPanel + v * kLanes,
                       _mm512_maskz_max_ps(kAll, squared, _mm512_setzero_ps()));
    }
  }
}

PLIANT_VNNI void SquaredTileVnni(const StepRows& a, std::size_t rows, std::size_t groups,
                                 const StepPanel& panel, float* out) {
  std::size_t r = 0;
  for (; r + 8 <= rows; r += 8) SquaredVnni<8>(a, r, groups, panel, out);
  for (; r < rows; ++r) SquaredVnni<1>(a, r, groups, panel, out);
}

#endif

std::vector<StepKernelSet> Supported() {
  std::vector<StepKernelSet> sets;
#if defined(__x86_64__)
  __builtin_cpu_init();
  const bool avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq");
  const bool vnni = avx512 && __builtin_cpu_supports("avx512vnni");
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  // With AVX-512 floats are faster than steps with AVX2.
  if (avx2 && (vnni || !avx512)) sets.push_back({"Avx2", SplitAvx2, SquaredTileAvx2});
  if (vnni) sets.push_back({"Vnni", SplitVnni, SquaredTileVnni});
#endif
  return sets;
}

}  // namespace

const std::vector<StepKernelSet>& StepKernels() {
  static const std::vector<StepKernelSet> sets = Supported();
  return sets;
}

}  // namespace kernels

std::optional<SteppedDescriptors> SteppedDescriptors::Of(const Descriptors& descriptors) {
  if (StepKernels().empty() || descriptors.kind != DescriptorKind::kFloat || descriptors.dim < 1 ||
      descriptors.dim > kMaxComponents) {
    return std::nullopt;
  }
  SteppedDescriptors result;
  if (!result.Split(descriptors)) return std::nullopt;
  result.Transpose();
  return result;
}

bool SteppedDescriptors::Split(const Descriptors& descriptors) {
  const auto& kernel = StepKernels().back();
  const auto dim = static_cast<std::size_t>(descriptors.dim);
  dim_ = descriptors.dim;
  rows_ = descriptors.rows;
  groups_ = (dim + kStepGroup - 1) / kStepGroup;
  const std::size_t width = groups_ * kStepGroup;
  const std::size_t padded = (rows_ + kPanel - 1) / kPanel * kPanel;
  steps_.assign(rows_ * width, 0);
  scales_.assign(padded, 0);
  norms_.assign(padded, std::numeric_limits<float>::infinity());  // padding is never near anything
  sums_.assign(rows_, 0);
  for (std::size_t r = 0; r < rows_; ++r) {
    std::int8_t* row = steps_.data() + r * width;
    if (!kernel.split(descriptors.floats.data() + r * dim, dim, row, &scales_[r])) return false;
    std::int32_t sum = 0;
    std::int32_t squares = 0;
    for (std::size_t p = 0; p < width; ++p) {
      sum += row[p];
      squares += row[p] * row[p];
    }
    sums_[r] = sum;
    norms_[r] = scales_[r] * scales_[r] * static_cast<float>(squares);
  }
  return true;
}

void SteppedDescriptors::Transpose() {
  const std::size_t width = groups_ * kStepGroup;
  panels_.assign(scales_.size() * width, 0);
  for (std::size_t j = 0; j < rows_; ++j) {
    const std::int8_t* row = steps_.data() + j * width;
    std::int8_t* panel = panels_.data() + j / kPanel * kPanel * width + j % kPanel * kStepGroup;
    for (std::size_t g = 0; g < groups_; ++g) {
      std::memcpy(panel + g * kPanel * kStepGroup, row + g * kStepGroup, kStepGroup);
    }
  }
}

void SteppedDescriptors::FindNearest(const SteppedDescriptors& queries, std::size_t first,
                                     std::size_t count, NearestTwo* nearest,
                                     NearestOne* nearest_query) const {
  kernels::CheckQueries(queries.dim_ == dim_, queries.dim_, dim_, first, count, queries.rows_);
  const auto& kernel = StepKernels().back();
  const std::size_t width = groups_ * kStepGroup;
  const auto fill_tile = [&](std::size_t r0, std::size_t block, std::size_t j0, float* tile) {
    const std::size_t row = first + r0;
    kernel.squared_tile({queries.steps_.data() + row * width, queries.scales_.data() + row,
                         queries.sums_.data() + row, queries.norms_.data() + row},
                        block, groups_,
                        {panels_.data() + j0 * width, scales_.data() + j0, norms_.data() + j0},
                        tile);
  };
  kernels::ScanForNearest(first, count, rows_, true, fill_tile, nearest, nearest_query);
}

}  // namespace pliant
