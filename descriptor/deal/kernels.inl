// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Included once for each instruction set (base/kernel_sets.inl).

namespace pliant::deal::PLIANT_KERNELS {
namespace {

#include "descriptor/base/kernel_vectors.inl"

// To bfloat16, the upper half of a float, rounded to nearest even.
PLIANT_INLINE void Store(const Vec& from, std::uint16_t* to) {
  using Bits = std::uint32_t __attribute__((vector_size(kWidth * sizeof(float))));
  using Halves = std::uint16_t __attribute__((vector_size(kWidth * 2)));
  const auto bits = reinterpret_cast<Bits>(from);
  const Halves upper = __builtin_convertvector((bits + 0x7fff + ((bits >> 16) & 1)) >> 16, Halves);
  std::memcpy(to, &upper, sizeof(upper));
}

inline float ClampCoordinate(float value, float last) {
  const float low = value > 0 ? value : 0.0F;  // also turns NaN to 0
  return low < last ? low : last;
}

void SamplePatch(const float* image, int height, int width, float x, float y, float radius,
                 const float* grid, const float* shift, float* patch) {
  const auto last_x = static_cast<float>(width - 1);
  const auto last_y = static_cast<float>(height - 1);
  const int max_column = width > 1 ? width - 2 : 0;
  const int max_row = height > 1 ? height - 2 : 0;
  const int right = width > 1 ? 1 : 0;
  const int down = height > 1 ? width : 0;
  float fraction_x[kPatchPixels];
  float fraction_y[kPatchPixels];
  int offset[kPatchPixels];
  for (int p = 0; p < kPatchPixels; ++p) {
    const float dx = shift != nullptr ? shift[p] : 0.0F;
    const float dy = shift != nullptr ? shift[kPatchPixels + p] : 0.0F;
    const float at_x = ClampCoordinate(x + radius * (grid[p] + dx), last_x);
    const float at_y = ClampCoordinate(y + radius * (grid[kPatchPixels + p] + dy), last_y);
    const int column = static_cast<int>(at_x) < max_column ? static_cast<int>(at_x) : max_column;
    const int row = static_cast<int>(at_y) < max_row ? static_cast<int>(at_y) : max_row;
    fraction_x[p] = at_x - static_cast<float>(column);
    fraction_y[p] = at_y - static_cast<float>(row);
    offset[p] = row * width + column;
  }
  for (int p = 0; p < kPatchPixels; ++p) {
    const int at = offset[p];
    const float top = image[at] + (image[at + right] - image[at]) * fraction_x[p];
    const float bottom =
        image[at + down] + (image[at + down + right] - image[at + down]) * fraction_x[p];
    patch[p] = top + (bottom - top) * fraction_y[p];
  }
}

inline int ClampCell(float cell, int last) {
  return cell > 0 ? (cell < static_cast<float>(last) ? static_cast<int>(cell) : last) : 0;
}

template <typename Value>
void SampleFeatures(const float* map, int height, int width, int channels, float x, float y,
                    Value* out) {
  constexpr int kCells = kNeighbours + 1;  // all 25 points share one fraction: 36 cells suffice
  const float floor_x = std::floor(x);
  const float floor_y = std::floor(y);
  const float fx = x - floor_x;
  const float fy = y - floor_y;
  const float* cells[kCells][kCells];
  for (int i = 0; i < kCells; ++i) {
    const int row = ClampCell(floor_y + static_cast<float>(i - kNeighbours / 2), height - 1);
    for (int j = 0; j < kCells; ++j) {
      const int column = ClampCell(floor_x + static_cast<float>(j - kNeighbours / 2), width - 1);
      cells[i][j] = map + (static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                           static_cast<std::size_t>(column)) *
                              static_cast<std::size_t>(channels);
    }
  }
  for (int i = 0; i < kNeighbours; ++i) {
    for (int j = 0; j < kNeighbours; ++j, out += channels) {
      for (int c = 0; c < channels; c += kWidth) {
        const Vec v00 = Load(cells[i][j] + c);
        const Vec v01 = Load(cells[i][j + 1] + c);
        const Vec v10 = Load(cells[i + 1][j] + c);
        const Vec v11 = Load(cells[i + 1][j + 1] + c);
        const Vec top = v00 + (v01 - v00) * fx;
        const Vec bottom = v10 + (v11 - v10) * fx;
        Store(top + (bottom - top) * fy, out + c);
      }
    }
  }
}

inline float SumLanes(const Vec& values) {
  float sum = 0;
  for (int i = 0; i < kWidth; ++i) sum += values[i];
  return sum;
}

void Standardize(const float* patch, float* framed) {
  Vec total = {};
  for (int p = 0; p < kPatchPixels; p += kWidth) total += Load(patch + p);
  const float mean = SumLanes(total) / kPatchPixels;
  total = Vec{};
  for (int p = 0; p < kPatchPixels; p += kWidth) {
    const Vec value = Load(patch + p) - mean;
    total += value * value;
  }
  const float scale = 1.0F / std::sqrt(SumLanes(total) / kPatchPixels + 1e-5F);
  for (int row = 0; row < kFramedSide; ++row) {
    const float* from = patch + (row + kPatchSide - 1) % kPatchSide * kPatchSide;
    float* to = framed + row * kFramedSide;
    to[0] = 0.0F;
    to[kFramedSide - 1] = 0.0F;
    for (int c = 0; c < kPatchSide; c += kWidth) Store((Load(from + c) - mean) * scale, to + 1 + c);
  }
}

template <typename Value>
void FirstConv(const float* framed, int channels, int stride, const float* weight,
               const float* bias, Value* out) {
  constexpr int kOutputs = 16;  // at once
  constexpr int kVecs = kOutputs / kWidth;
  constexpr int kPixels = kWidth > 8 ? 16 : (kWidth > 4 ? 4 : 2);  // as the registers allow
  const Vec zero = {};
  const int side = kPatchSide / stride;
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; column += kPixels, out += kPixels * channels) {
      for (int first = 0; first < channels; first += kOutputs) {
        Vec sum[kPixels][kVecs];
        for (int p = 0; p < kPixels; ++p) {
          for (int v = 0; v < kVecs; ++v) sum[p][v] = Load(bias + first + v * kWidth);
        }
        for (int tap = 0; tap < 9; ++tap) {
          const float* in =
              framed + (row * stride + tap / 3) * kFramedSide + column * stride + tap % 3;
          for (int v = 0; v < kVecs; ++v) {
            const Vec w = Load(weight + tap * channels + first + v * kWidth);
            for (int p = 0; p < kPixels; ++p) sum[p][v] += w * in[p * stride];
          }
        }
        for (int p = 0; p < kPixels; ++p) {
          for (int v = 0; v < kVecs; ++v) {
            Store(sum[p][v] > zero ? sum[p][v] : zero, out + p * channels + first + v * kWidth);
          }
        }
      }
    }
  }
}

// One row of B^T d (Lavin and Gray 2016, section 4.3); six vectors in, six out, `step` apart.
PLIANT_INLINE void InputRow(const Vec* d, Vec* t, int step) {
  const Vec even = d[4 * step] - 4.0F * d[2 * step];
  const Vec odd = d[3 * step] - 4.0F * d[step];
  const Vec even2 = d[4 * step] - d[2 * step];
  const Vec odd2 = 2.0F * (d[3 * step] - d[step]);
  const Vec first = 4.0F * d[0] - 5.0F * d[2 * step] + d[4 * step];
  const Vec last = 4.0F * d[step] - 5.0F * d[3 * step] + d[5 * step];
  t[0] = first;
  t[step] = even + odd;
  t[2 * step] = even - odd;
  t[3 * step] = even2 + odd2;
  t[4 * step] = even2 - odd2;
  t[5 * step] = last;
}

void WinogradInput(const float* in, int side, int channels, std::size_t plane, float* tiles) {
  for (int tile_y = 0; tile_y < side; tile_y += kTileSide) {
    const float* rows[6];
    for (int i = 0; i < 6; ++i) {
      rows[i] = in + static_cast<std::ptrdiff_t>((tile_y + i - 1 + side) % side) * side * channels;
    }
    for (int tile_x = 0; tile_x < side; tile_x += kTileSide, tiles += channels) {
      for (int c = 0; c < channels; c += kWidth) {
        Vec d[36];
#pragma GCC unroll 6
        for (int j = 0; j < 6; ++j) {
          const bool outside = (j == 0 && tile_x == 0) || (j == 5 && tile_x + kTileSide == side);
#pragma GCC unroll 6
          for (int i = 0; i < 6; ++i) {
            d[i * 6 + j] = Vec{};
            if (!outside) d[i * 6 + j] = Load(rows[i] + (tile_x + j - 1) * channels + c);
          }
          InputRow(d + j, d + j, 6);
        }
#pragma GCC unroll 6
        for (int i = 0; i < 6; ++i) {
          InputRow(d + i * 6, d + i * 6, 1);
#pragma GCC unroll 6
          for (int j = 0; j < 6; ++j) {
            Store(d[i * 6 + j], tiles + static_cast<std::size_t>(i * 6 + j) * plane + c);
          }
        }
      }
    }
  }
}

// One row of A^T m; six vectors in, four out, `step` apart.
PLIANT_INLINE void OutputRow(const Vec* m, Vec* t, int step) {
  const Vec sum1 = m[step] + m[2 * step];
  const Vec difference1 = m[step] - m[2 * step];
  const Vec sum2 = m[3 * step] + m[4 * step];
  const Vec difference2 = m[3 * step] - m[4 * step];
  const Vec last = m[5 * step];
  t[0] = m[0] + sum1 + sum2;
  t[step] = difference1 + 2.0F * difference2;
  t[2 * step] = sum1 + 4.0F * sum2;
  t[3 * step] = difference1 + 8.0F * difference2 + last;
}

// The 4 x 4 outputs of one tile, after bias and ReLU, in m[6 * row + column].
PLIANT_INLINE void OutputTile(const float* tile, std::size_t plane, const float* bias, Vec* m) {
  const Vec zero = {};
  const Vec b = Load(bias);
#pragma GCC unroll 6
  for (int j = 0; j < 6; ++j) {
#pragma GCC unroll 6
    for (int i = 0; i < 6; ++i) {
      m[i * 6 + j] = Load(tile + static_cast<std::size_t>(i * 6 + j) * plane);
    }
    OutputRow(m + j, m + j, 6);
  }
#pragma GCC unroll 4
  for (int i = 0; i < kTileSide; ++i) {
    OutputRow(m + i * 6, m + i * 6, 1);
#pragma GCC unroll 4
    for (int j = 0; j < kTileSide; ++j) {
      const Vec value = m[i * 6 + j] + b;
      m[i * 6 + j] = value > zero ? value : zero;
    }
  }
}

void WinogradOutput(const float* tiles, int side, int channels, std::size_t plane,
                    const float* bias, float* out) {
  for (int tile_y = 0; tile_y < side; tile_y += kTileSide) {
    for (int tile_x = 0; tile_x < side; tile_x += kTileSide, tiles += channels) {
      for (int c = 0; c < channels; c += kWidth) {
        Vec m[36];
        OutputTile(tiles + c, plane, bias + c, m);
#pragma GCC unroll 4
        for (int i = 0; i < kTileSide; ++i) {
          float* row = out + static_cast<std::ptrdiff_t>((tile_y + i) * side + tile_x) * channels;
#pragma GCC unroll 4
          for (int j = 0; j < kTileSide; ++j) Store(m[i * 6 + j], row + j * channels + c);
        }
      }
    }
  }
}

void WinogradPooled(const float* tiles, int side, int channels, std::size_t plane,
                    const float* bias, float* out) {
  const int across = side / kTileSide;
  const float share = 1.0F / static_cast<float>(side);
  for (int tile_x = 0; tile_x < across; ++tile_x) {
    for (int c = 0; c < channels; c += kWidth) {
      Vec sum[kTileSide] = {};
      for (int tile_y = 0; tile_y < across; ++tile_y) {
        Vec m[36];
        OutputTile(tiles + (tile_y * across + tile_x) * channels + c, plane, bias + c, m);
#pragma GCC unroll 4
        for (int i = 0; i < kTileSide; ++i) {
#pragma GCC unroll 4
          for (int j = 0; j < kTileSide; ++j) sum[j] += m[i * 6 + j];
        }
      }
      for (int j = 0; j < kTileSide; ++j) {
        Store(sum[j] * share, out + (tile_x * kTileSide + j) * channels + c);
      }
    }
  }
}

}  // namespace

extern const Kernels kTable;
const Kernels kTable = {PLIANT_TEXT(PLIANT_KERNELS),
                        SamplePatch,
                        SampleFeatures<float>,
                        SampleFeatures<std::uint16_t>,
                        Standardize,
                        FirstConv<float>,
                        FirstConv<std::uint16_t>,
                        WinogradInput,
                        WinogradOutput,
                        WinogradPooled};

}  // namespace pliant::deal::PLIANT_KERNELS
