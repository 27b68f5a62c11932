// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/photo.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace pliant::simulation {
namespace {

// Linear light 0..1 to the tone curve's output 0..255, over 4096 steps of the square root (which
// spends the steps where the curve is steep).
class ToneCurve {
 public:
  explicit ToneCurve(const PhotoOptions& options) {
    for (std::size_t i = 0; i < table_.size(); ++i) {
      const float root = static_cast<float>(i) / static_cast<float>(table_.size() - 1);
      const float x = root * root;
      const float srgb = x <= 0.0031308F ? 12.92F * x : 1.055F * std::pow(x, 1.0F / 2.4F) - 0.055F;
      const float toned = std::pow(srgb, options.gamma);
      table_[i] = 255.0F * (options.black + (1.0F - options.black) * toned);
    }
  }
  float At(float linear) const {
    const float root = std::sqrt(std::clamp(linear, 0.0F, 1.0F));
    return table_[static_cast<std::size_t>(root * static_cast<float>(table_.size() - 1) + 0.5F)];
  }

 private:
  std::array<float, 4096> table_{};
};

// Normal numbers made once; an image walks through them from random places.
const std::vector<float>& NormalTable() {
  static const std::vector<float> table = [] {
    Random random(20211206);
    std::vector<float> values(1U << 16U);
    for (float& value : values) value = random.Normal();
    return values;
  }();
  return table;
}

void MotionBlur(std::vector<Colour>& pixels, int width, int height, float length, float angle) {
  const std::vector<Colour> source = pixels;
  const int taps = std::max(2, static_cast<int>(std::ceil(length)) + 1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Colour sum = Colour::Zero();
      for (int tap = 0; tap < taps; ++tap) {
        const float t = (static_cast<float>(tap) / static_cast<float>(taps - 1) - 0.5F) * length;
        const int sx =
            std::clamp(static_cast<int>(std::lround(static_cast<float>(x) + t * std::cos(angle))),
                       0, width - 1);
        const int sy =
            std::clamp(static_cast<int>(std::lround(static_cast<float>(y) + t * std::sin(angle))),
                       0, height - 1);
        sum += source[static_cast<std::size_t>(sy) * static_cast<std::size_t>(width) +
                      static_cast<std::size_t>(sx)];
      }
      pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
             static_cast<std::size_t>(x)] = sum / static_cast<float>(taps);
    }
  }
}

}  // namespace

float MeterExposure(const Frame& frame) {
  constexpr float kMiddleGrey = 0.2F;
  double object = 0.0;
  double all = 0.0;
  std::size_t on = 0;
  for (std::size_t i = 0; i < frame.colour.size(); ++i) {
    const float light = std::min(1.0F, frame.colour[i].head<3>().mean());
    all += light;
    if (frame.chart[i] == kNoChart) continue;
    object += light;
    ++on;
  }
  all /= static_cast<double>(frame.colour.size());
  if (on > 0) object /= static_cast<double>(on);
  // Mostly for the object, a little for the whole image; not so far as to make night day.
  const double mean = on > 0 ? 0.75 * object + 0.25 * all : all;
  return std::clamp(kMiddleGrey / static_cast<float>(std::max(mean, 1e-4)), 0.4F, 5.0F);
}

float MeterImage(const Frame& frame) {
  constexpr float kMiddleGrey = 0.2F;
  double all = 0.0;
  for (const Colour& colour : frame.colour) all += std::min(1.0F, colour.head<3>().mean());
  all /= static_cast<double>(frame.colour.size());
  return std::clamp(kMiddleGrey / static_cast<float>(std::max(all, 1e-4)), 0.4F, 5.0F);
}

PhotoOptions DrawPhoto(Random& random, float strength) {
  PhotoOptions photo;
  photo.exposure = std::exp(random.Normal() * 0.28F * strength);
  photo.white_balance = Colour(std::exp(random.Normal() * 0.08F * strength), 1.0F,
                               std::exp(random.Normal() * 0.08F * strength), 0.0F);
  photo.gamma = std::exp(random.Normal() * 0.15F * strength);
  photo.vignette = random.Chance(0.6F) ? random.Uniform(0.0F, 0.45F) * strength : 0.0F;
  photo.defocus_px =
      random.Chance(0.3F) ? random.Uniform(0.6F, 1.4F) * strength : random.Uniform(0.3F, 0.6F);
  if (random.Chance(0.12F * strength)) photo.motion_px = random.Uniform(1.5F, 5.0F);
  photo.motion_angle = random.Angle();
  photo.black = random.Chance(0.3F) ? random.Uniform(0.0F, 0.1F) * strength : 0.0F;
  photo.read_noise = random.LogUniform(0.3F, 3.0F) * strength;
  photo.shot_noise = random.LogUniform(0.5F, 6.0F) * strength;
  photo.jpeg_quality =
      random.Chance(0.6F) ? random.Integer(static_cast<int>(95.0F - 50.0F * strength), 96) : 0;
  return photo;
}

void Blur(std::vector<Colour>& pixels, int width, int height, float sigma_px) {
  const int radius = static_cast<int>(std::ceil(2.5F * sigma_px));
  if (radius < 1) return;
  std::vector<float> kernel;
  float sum = 0.0F;
  for (int i = -radius; i <= radius; ++i) {
    kernel.push_back(std::exp(-0.5F * static_cast<float>(i * i) / (sigma_px * sigma_px)));
    sum += kernel.back();
  }
  for (float& weight : kernel) weight /= sum;
  const auto row_size = static_cast<std::size_t>(width);
  // Along rows, with the ends repeated.
  std::vector<Colour> line(row_size + 2 * static_cast<std::size_t>(radius));
  for (int y = 0; y < height; ++y) {
    Colour* row = pixels.data() + static_cast<std::size_t>(y) * row_size;
    std::copy_n(row, row_size, line.begin() + radius);
    std::fill_n(line.begin(), radius, row[0]);
    std::fill_n(line.end() - radius, radius, row[row_size - 1]);
    for (std::size_t x = 0; x < row_size; ++x) {
      Colour value = Colour::Zero();
      for (std::size_t k = 0; k < kernel.size(); ++k) value += kernel[k] * line[x + k];
      row[x] = value;
    }
  }
  // Along columns, a whole row at a time so that memory is read in order.
  const std::vector<Colour> source = pixels;
  for (int y = 0; y < height; ++y) {
    Colour* row = pixels.data() + static_cast<std::size_t>(y) * row_size;
    std::fill_n(row, row_size, Colour::Zero());
    for (int k = -radius; k <= radius; ++k) {
      const int from = std::clamp(y + k, 0, height - 1);
      const Colour* in = source.data() + static_cast<std::size_t>(from) * row_size;
      const float weight = kernel[static_cast<std::size_t>(k + radius)];
      for (std::size_t x = 0; x < row_size; ++x) row[x] += weight * in[x];
    }
  }
}

Image TakePhoto(Frame& frame, const PhotoOptions& options, int channels, Random& random) {
  if (options.defocus_px > 0.0F) Blur(frame.colour, frame.width, frame.height, options.defocus_px);
  if (options.motion_px > 0.0F)
    MotionBlur(frame.colour, frame.width, frame.height, options.motion_px, options.motion_angle);
  Image image{frame.width, frame.height, channels, {}};
  image.pixels.resize(frame.colour.size() * static_cast<std::size_t>(channels));
  const ToneCurve curve(options);
  const std::vector<float>& normal = NormalTable();
  const std::size_t mask = normal.size() - 1;
  const float half_x = 0.5F * static_cast<float>(frame.width);
  const float half_y = 0.5F * static_cast<float>(frame.height);
  const float corner = half_x * half_x + half_y * half_y;
  const float read = options.read_noise * options.read_noise;
  const float shot = options.shot_noise * options.shot_noise / 255.0F;
  std::uint8_t* out = image.pixels.data();
  for (int y = 0; y < frame.height; ++y) {
    std::size_t draw = random.Next();
    const float dy = static_cast<float>(y) - half_y;
    for (int x = 0; x < frame.width; ++x) {
      const float dx = static_cast<float>(x) - half_x;
      const float light =
          options.exposure * (1.0F - options.vignette * (dx * dx + dy * dy) / corner);
      const Colour linear = frame.colour[frame.At(x, y)] * options.white_balance * light;
      std::array<float, 3> value{curve.At(linear[0]), curve.At(linear[1]), curve.At(linear[2])};
      if (channels == 1) value[0] = 0.299F * value[0] + 0.587F * value[1] + 0.114F * value[2];
      for (int c = 0; c < channels; ++c) {
        const float mean = value[static_cast<std::size_t>(c)];
        const float noisy = mean + normal[draw++ & mask] * std::sqrt(read + shot * mean);
        *out++ = static_cast<std::uint8_t>(std::clamp(noisy + 0.5F, 0.0F, 255.0F));
      }
    }
  }
  if (options.jpeg_quality > 0) AddJpegArtefacts(image, options.jpeg_quality);
  return image;
}

}  // namespace pliant::simulation
