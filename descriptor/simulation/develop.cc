// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/develop.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace pliant::simulation {
namespace {

std::uint8_t ToByte(float value) {
  return static_cast<std::uint8_t>(std::clamp(value + 0.5F, 0.0F, 255.0F));
}

std::size_t Samples(const Image& image) {
  return static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
}

// The image as colours, to be blurred.
std::vector<Colour> ToColours(const Image& image) {
  std::vector<Colour> colours(Samples(image), Colour::Zero());
  const auto channels = static_cast<std::size_t>(image.channels);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    colours[i / channels][static_cast<int>(i % channels)] = static_cast<float>(image.pixels[i]);
  return colours;
}

void CurveTones(Image& image, float contrast) {
  std::array<std::uint8_t, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const float x = static_cast<float>(i) / 255.0F;
    const float curved = x * x * (3.0F - 2.0F * x);
    table[i] = ToByte(255.0F * std::clamp(x + contrast * (curved - x), 0.0F, 1.0F));
  }
  for (std::uint8_t& pixel : image.pixels) pixel = table[pixel];
}

// Smooths where a pixel is nearly its surroundings' mean, and leaves edges alone.
void Smear(Image& image, float amount) {
  constexpr float kEdge = 14.0F;  // of 255
  std::vector<Colour> smooth = ToColours(image);
  Blur(smooth, image.width, image.height, 1.1F);
  const auto channels = static_cast<std::size_t>(image.channels);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const float pixel = image.pixels[i];
    const float difference = smooth[i / channels][static_cast<int>(i % channels)] - pixel;
    const float likely = std::exp(-difference * difference / (kEdge * kEdge));
    image.pixels[i] = ToByte(pixel + amount * likely * difference);
  }
}

// Stored with the corner of the blocks `shift` pixels inside the image.
void StoreAgain(Image& image, int quality, int shift) {
  Image moved{image.width + shift, image.height + shift, image.channels, {}};
  moved.pixels.reserve(Samples(moved) * static_cast<std::size_t>(image.channels));
  const auto row_bytes = static_cast<std::ptrdiff_t>(image.width) * image.channels;
  for (int y = 0; y < moved.height; ++y) {
    const auto row = image.pixels.begin() + std::max(0, y - shift) * row_bytes;
    for (int x = 0; x < shift; ++x)
      moved.pixels.insert(moved.pixels.end(), row, row + image.channels);
    moved.pixels.insert(moved.pixels.end(), row, row + row_bytes);
  }
  AddJpegArtefacts(moved, quality);
  const auto moved_bytes = static_cast<std::ptrdiff_t>(moved.width) * image.channels;
  for (int y = 0; y < image.height; ++y) {
    const auto from = moved.pixels.begin() + (y + shift) * moved_bytes +
                      static_cast<std::ptrdiff_t>(shift) * image.channels;
    std::copy_n(from, row_bytes, image.pixels.begin() + y * row_bytes);
  }
}

// Taps of one axis: for each pixel of the larger image the first source pixel and four weights.
struct Taps {
  std::vector<int> first;
  std::vector<std::array<float, 4>> weight;
};

Taps MakeTaps(int from, int to, bool cubic) {
  Taps taps;
  const float ratio = static_cast<float>(from) / static_cast<float>(to);
  for (int i = 0; i < to; ++i) {
    const float at = (static_cast<float>(i) + 0.5F) * ratio - 0.5F;
    const float floor = std::floor(at);
    const float t = at - floor;
    taps.first.push_back(static_cast<int>(floor) - 1);
    if (!cubic) {
      taps.weight.push_back({0.0F, 1.0F - t, t, 0.0F});
      continue;
    }
    // Catmull and Rom's cubic.
    taps.weight.push_back({((-0.5F * t + 1.0F) * t - 0.5F) * t, (1.5F * t - 2.5F) * t * t + 1.0F,
                           ((-1.5F * t + 2.0F) * t + 0.5F) * t, (0.5F * t - 0.5F) * t * t});
  }
  return taps;
}

}  // namespace

DevelopOptions DrawDevelop(Random& random, float strength) {
  DevelopOptions options;
  options.enlarge = random.Chance(0.4F) ? 1.0F : random.LogUniform(1.2F, 1.0F + 1.6F * strength);
  options.cubic = random.Chance(0.6F);
  options.contrast = random.Chance(0.5F) ? strength * random.Uniform(-0.4F, 0.9F) : 0.0F;
  options.smear = random.Chance(0.4F) ? strength * random.Uniform(0.3F, 1.0F) : 0.0F;
  options.sharpen = random.Chance(0.6F) ? strength * random.Uniform(0.2F, 1.6F) : 0.0F;
  options.sharpen_px = random.LogUniform(0.5F, 1.6F);
  options.jpeg_quality =
      random.Chance(0.6F) ? random.Integer(static_cast<int>(92.0F - 45.0F * strength), 95) : 0;
  options.jpeg_shift = random.Integer(0, 7);
  return options;
}

Frame Shrink(const Frame& frame, int width, int height) {
  Frame small;
  small.width = width;
  small.height = height;
  const float step_x = static_cast<float>(frame.width) / static_cast<float>(width);
  const float step_y = static_cast<float>(frame.height) / static_cast<float>(height);
  small.colour.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  // How much of pixel i lies between two borders.
  const auto share = [](int i, float low, float high) {
    return std::min(high, static_cast<float>(i + 1)) - std::max(low, static_cast<float>(i));
  };
  for (int y = 0; y < height; ++y) {
    const float top = static_cast<float>(y) * step_y;
    const float bottom = std::min(top + step_y, static_cast<float>(frame.height));
    for (int x = 0; x < width; ++x) {
      const float left = static_cast<float>(x) * step_x;
      const float right = std::min(left + step_x, static_cast<float>(frame.width));
      Colour sum = Colour::Zero();
      float area = 0.0F;
      for (int j = static_cast<int>(top); static_cast<float>(j) < bottom; ++j) {
        for (int i = static_cast<int>(left); static_cast<float>(i) < right; ++i) {
          const float part = share(i, left, right) * share(j, top, bottom);
          sum += part * frame.colour[frame.At(i, j)];
          area += part;
        }
      }
      small.colour.emplace_back(sum / area);
    }
  }
  return small;
}

Image Enlarge(const Image& image, int width, int height, bool cubic) {
  const Taps across = MakeTaps(image.width, width, cubic);
  const Taps down = MakeTaps(image.height, height, cubic);
  const auto channels = static_cast<std::size_t>(image.channels);
  const auto row = [channels](int pixels) { return static_cast<std::size_t>(pixels) * channels; };
  std::vector<float> wide(row(width) * static_cast<std::size_t>(image.height), 0.0F);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* in = image.pixels.data() + static_cast<std::size_t>(y) * row(image.width);
    float* out = wide.data() + static_cast<std::size_t>(y) * row(width);
    for (std::size_t x = 0; x < static_cast<std::size_t>(width); ++x) {
      for (int tap = 0; tap < 4; ++tap) {
        const int at = std::clamp(across.first[x] + tap, 0, image.width - 1);
        const float weight = across.weight[x][static_cast<std::size_t>(tap)];
        for (std::size_t c = 0; c < channels; ++c)
          out[x * channels + c] += weight * static_cast<float>(in[row(at) + c]);
      }
    }
  }
  Image large{width, height, image.channels, {}};
  large.pixels.reserve(row(width) * static_cast<std::size_t>(height));
  for (std::size_t y = 0; y < static_cast<std::size_t>(height); ++y) {
    for (std::size_t i = 0; i < row(width); ++i) {
      float sum = 0.0F;
      for (int tap = 0; tap < 4; ++tap) {
        const int at = std::clamp(down.first[y] + tap, 0, image.height - 1);
        sum += down.weight[y][static_cast<std::size_t>(tap)] *
               wide[static_cast<std::size_t>(at) * row(width) + i];
      }
      large.pixels.push_back(ToByte(sum));
    }
  }
  return large;
}

void Sharpen(Image& image, float amount, float sigma_px) {
  std::vector<Colour> smooth = ToColours(image);
  Blur(smooth, image.width, image.height, sigma_px);
  const auto channels = static_cast<std::size_t>(image.channels);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const float pixel = image.pixels[i];
    const float mean = smooth[i / channels][static_cast<int>(i % channels)];
    image.pixels[i] = ToByte(pixel + amount * (pixel - mean));
  }
}

Image Develop(Frame& frame, const PhotoOptions& photo, const DevelopOptions& options, int channels,
              Random& random) {
  const int width = frame.width;
  const int height = frame.height;
  const bool fewer = options.enlarge > 1.01F;
  Frame small;
  if (fewer) {
    const auto part = [&](int side) {
      return std::max(16,
                      static_cast<int>(std::lround(static_cast<float>(side) / options.enlarge)));
    };
    small = Shrink(frame, part(width), part(height));
  }
  Image image = TakePhoto(fewer ? small : frame, photo, channels, random);
  if (options.smear > 0.0F) Smear(image, options.smear);
  if (options.contrast != 0.0F) CurveTones(image, options.contrast);
  if (options.sharpen > 0.0F) Sharpen(image, options.sharpen, options.sharpen_px);
  if (options.jpeg_quality > 0) StoreAgain(image, options.jpeg_quality, options.jpeg_shift);
  return fewer ? Enlarge(image, width, height, options.cubic) : image;
}

}  // namespace pliant::simulation
