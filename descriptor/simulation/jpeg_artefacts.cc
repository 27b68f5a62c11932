// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "descriptor/simulation/photo.h"

namespace pliant::simulation {
namespace {

using Block = Eigen::Matrix<float, 8, 8, Eigen::RowMajor>;

// ITU-T T.81, tables K.1 (luminance) and K.2 (chrominance).
constexpr std::array<int, 64> kLuminance = {
    16, 11, 10, 16, 24,  40,  51,  61,  12, 12, 14, 19, 26,  58,  60,  55,
    14, 13, 16, 24, 40,  57,  69,  56,  14, 17, 22, 29, 51,  87,  80,  62,
    18, 22, 37, 56, 68,  109, 103, 77,  24, 35, 55, 64, 81,  104, 113, 92,
    49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99};
constexpr std::array<int, 64> kChrominance = {
    17, 18, 24, 47, 99, 99, 99, 99, 18, 21, 26, 66, 99, 99, 99, 99, 24, 26, 56, 99, 99, 99,
    99, 99, 47, 66, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99,
    99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99};

Block CosineBasis() {
  Block basis;
  for (int k = 0; k < 8; ++k) {
    for (int n = 0; n < 8; ++n) {
      const float scale = k == 0 ? std::sqrt(0.125F) : 0.5F;
      basis(k, n) = scale * std::cos(std::numbers::pi_v<float> * (static_cast<float>(n) + 0.5F) *
                                     static_cast<float>(k) / 8.0F);
    }
  }
  return basis;
}

Block QuantisationTable(const std::array<int, 64>& base, int quality) {
  const int scale = quality < 50 ? 5000 / quality : 200 - 2 * quality;
  Block table;
  for (int i = 0; i < 64; ++i) {
    table.data()[i] = static_cast<float>(
        std::clamp((base[static_cast<std::size_t>(i)] * scale + 50) / 100, 1, 255));
  }
  return table;
}

// One plane of values around 0; sizes need not be multiples of 8, the border is repeated.
void QuantisePlane(std::vector<float>& plane, int width, int height, const Block& table) {
  static const Block basis = CosineBasis();
  const auto at = [&](int x, int y) -> float& {
    return plane[static_cast<std::size_t>(std::min(y, height - 1)) *
                     static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(std::min(x, width - 1))];
  };
  for (int y0 = 0; y0 < height; y0 += 8) {
    for (int x0 = 0; x0 < width; x0 += 8) {
      Block block;
      for (int y = 0; y < 8; ++y) {
        for (int x = 0; x < 8; ++x) block(y, x) = at(x0 + x, y0 + y);
      }
      const Block half = basis.lazyProduct(block);
      Block coefficients = half.lazyProduct(basis.transpose());
      // Rounds to the nearest integer by the usual trick of a large addend.
      constexpr float kRound = 12582912.0F;
      for (int i = 0; i < 64; ++i) {
        const float scaled = coefficients.data()[i] / table.data()[i];
        coefficients.data()[i] = ((scaled + kRound) - kRound) * table.data()[i];
      }
      const Block back = basis.transpose().lazyProduct(coefficients);
      block = back.lazyProduct(basis);
      for (int y = 0; y < std::min(8, height - y0); ++y) {
        for (int x = 0; x < std::min(8, width - x0); ++x) at(x0 + x, y0 + y) = block(y, x);
      }
    }
  }
}

// Colour planes are stored at half size (4:2:0).
std::vector<float> HalfPlane(const std::vector<float>& plane, int width, int height) {
  const int half_width = (width + 1) / 2;
  const int half_height = (height + 1) / 2;
  std::vector<float> half;
  half.reserve(static_cast<std::size_t>(half_width) * static_cast<std::size_t>(half_height));
  const auto at = [&](int x, int y) {
    return plane[static_cast<std::size_t>(std::min(y, height - 1)) *
                     static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(std::min(x, width - 1))];
  };
  for (int y = 0; y < half_height; ++y) {
    for (int x = 0; x < half_width; ++x) {
      half.push_back(0.25F * (at(2 * x, 2 * y) + at(2 * x + 1, 2 * y) + at(2 * x, 2 * y + 1) +
                              at(2 * x + 1, 2 * y + 1)));
    }
  }
  return half;
}

std::uint8_t ToByte(float value) {
  return static_cast<std::uint8_t>(std::clamp(value + 0.5F, 0.0F, 255.0F));
}

}  // namespace

void AddJpegArtefacts(Image& image, int quality) {
  const auto count = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  const Block luminance = QuantisationTable(kLuminance, quality);
  std::vector<float> y(count);
  if (image.channels == 1) {
    for (std::size_t i = 0; i < count; ++i) y[i] = static_cast<float>(image.pixels[i]) - 128.0F;
    QuantisePlane(y, image.width, image.height, luminance);
    for (std::size_t i = 0; i < count; ++i) image.pixels[i] = ToByte(y[i] + 128.0F);
    return;
  }
  std::vector<float> cb(count), cr(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto r = static_cast<float>(image.pixels[3 * i]);
    const auto g = static_cast<float>(image.pixels[3 * i + 1]);
    const auto b = static_cast<float>(image.pixels[3 * i + 2]);
    y[i] = 0.299F * r + 0.587F * g + 0.114F * b - 128.0F;
    cb[i] = -0.168736F * r - 0.331264F * g + 0.5F * b;
    cr[i] = 0.5F * r - 0.418688F * g - 0.081312F * b;
  }
  const int half_width = (image.width + 1) / 2;
  const int half_height = (image.height + 1) / 2;
  const Block chrominance = QuantisationTable(kChrominance, quality);
  cb = HalfPlane(cb, image.width, image.height);
  cr = HalfPlane(cr, image.width, image.height);
  QuantisePlane(y, image.width, image.height, luminance);
  QuantisePlane(cb, half_width, half_height, chrominance);
  QuantisePlane(cr, half_width, half_height, chrominance);
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const auto i = static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width) +
                     static_cast<std::size_t>(column);
      const auto h = static_cast<std::size_t>(row / 2) * static_cast<std::size_t>(half_width) +
                     static_cast<std::size_t>(column / 2);
      image.pixels[3 * i] = ToByte(y[i] + 128.0F + 1.402F * cr[h]);
      image.pixels[3 * i + 1] = ToByte(y[i] + 128.0F - 0.344136F * cb[h] - 0.714136F * cr[h]);
      image.pixels[3 * i + 2] = ToByte(y[i] + 128.0F + 1.772F * cb[h]);
    }
  }
}

}  // namespace pliant::simulation
