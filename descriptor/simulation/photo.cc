// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/photo.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace pliant::simulation {
namespace {

// Linear light 0..1 to the tone curve's output 0..255, over 4096 steps of the square root (which
// spends the steps where the curve is steep).
class ToneCurve {
 public:
  explicit ToneCurve(const PhotoOptions& options) {
    for (std::size_t i = 0; i < table_.size(); ++i) {
      const float root = static_cast<float>(i) / (table_.size() - 1);
      const float x = root * root;
      const float srgb = x <= 0.0031308F ? 12.92F * x : 1.055F * std::pow(x, 1.0F / 2.4F) - 0.055F;
      const float toned = std::pow(srgb, options.gamma);
      table_[i] = 255.0F * (options.black + (1.0F - options.black) * toned);
    }
  }
  float At(float linear) const {
    const float root = std::sqrt(std::clamp(linear, 0.0F, 1.0F));
    return table_[static_cast<std::size_t>(root * (table_.size() - 1) + 0.5F)];
  }

 private:
  std::array<float, 4096> table_{};
};

// Normal random numbers, made once; an image reads them from random positions on.
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
        const float t = (static_cast<float>(tap) / (taps - 1) - 0.5F) * length;
        const int sx =
            std::clamp(static_cast<int>(std::lround(x + t * std::cos(angle))), 0, width - 1);
        const int sy =
            std::clamp(static_cast<int>(std::lround(y + t * std::sin(angle))), 0, height - 1);
        sum += source[static_cast<std::size_t>(sy) * width + sx];
      }
      pixels[static_cast<std::size_t>(y) * width + x] = sum / static_cast<float>(taps);
    }
  }
}

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
      basis(k, n) = scale * std::cos(kPi * (n + 0.5F) * static_cast<float>(k) / 8.0F);
    }
  }
  return basis;
}

Block QuantisationTable(const std::array<int, 64>& base, int quality) {
  const int scale = quality < 50 ? 5000 / quality : 200 - 2 * quality;
  Block table;
  for (int i = 0; i < 64; ++i) {
    table.data()[i] = static_cast<float>(std::clamp((base[i] * scale + 50) / 100, 1, 255));
  }
  return table;
}

// One plane of values around 0; sizes need not be multiples of 8, the border is repeated.
void QuantisePlane(std::vector<float>& plane, int width, int height, const Block& table) {
  static const Block basis = CosineBasis();
  const auto at = [&](int x, int y) -> float& {
    return plane[static_cast<std::size_t>(std::min(y, height - 1)) * width +
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
  half.reserve(static_cast<std::size_t>(half_width) * half_height);
  const auto at = [&](int x, int y) {
    return plane[static_cast<std::size_t>(std::min(y, height - 1)) * width +
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

std::size_t Samples(const Image& image) {
  return static_cast<std::size_t>(image.width) * image.height;
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
    const float x = i / 255.0F;
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
  const float ratio = static_cast<float>(from) / to;
  for (int i = 0; i < to; ++i) {
    const float at = (i + 0.5F) * ratio - 0.5F;
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

float MeterExposure(const Frame& frame, float object_share) {
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
  const double mean = on > 0 ? object_share * object + (1.0 - object_share) * all : all;
  // Not so far as to make night day.
  return std::clamp(kMiddleGrey / static_cast<float>(std::max(mean, 1e-4)), 0.4F, 5.0F);
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
    kernel.push_back(std::exp(-0.5F * (i * i) / (sigma_px * sigma_px)));
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
      const float weight = kernel[k + radius];
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
  const float half_x = 0.5F * frame.width;
  const float half_y = 0.5F * frame.height;
  const float corner = half_x * half_x + half_y * half_y;
  const float read = options.read_noise * options.read_noise;
  const float shot = options.shot_noise * options.shot_noise / 255.0F;
  std::uint8_t* out = image.pixels.data();
  for (int y = 0; y < frame.height; ++y) {
    std::size_t draw = random.Next();
    const float dy = y - half_y;
    for (int x = 0; x < frame.width; ++x) {
      const float dx = x - half_x;
      const float light =
          options.exposure * (1.0F - options.vignette * (dx * dx + dy * dy) / corner);
      const Colour linear = frame.colour[frame.At(x, y)] * options.white_balance * light;
      std::array<float, 3> value{curve.At(linear[0]), curve.At(linear[1]), curve.At(linear[2])};
      if (channels == 1) value[0] = 0.299F * value[0] + 0.587F * value[1] + 0.114F * value[2];
      for (int c = 0; c < channels; ++c) {
        const float mean = value[c];
        const float noisy = mean + normal[draw++ & mask] * std::sqrt(read + shot * mean);
        *out++ = ToByte(noisy);
      }
    }
  }
  if (options.jpeg_quality > 0) AddJpegArtefacts(image, options.jpeg_quality);
  return image;
}

void AddJpegArtefacts(Image& image, int quality) {
  const auto count = static_cast<std::size_t>(image.width) * image.height;
  const Block luminance = QuantisationTable(kLuminance, quality);
  std::vector<float> y(count);
  if (image.channels == 1) {
    for (std::size_t i = 0; i < count; ++i) y[i] = image.pixels[i] - 128.0F;
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
      const auto i = static_cast<std::size_t>(row) * image.width + column;
      const auto h =
          static_cast<std::size_t>(row / 2) * half_width + static_cast<std::size_t>(column / 2);
      image.pixels[3 * i] = ToByte(y[i] + 128.0F + 1.402F * cr[h]);
      image.pixels[3 * i + 1] = ToByte(y[i] + 128.0F - 0.344136F * cb[h] - 0.714136F * cr[h]);
      image.pixels[3 * i + 2] = ToByte(y[i] + 128.0F + 1.772F * cb[h]);
    }
  }
}

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
  const float step_x = static_cast<float>(frame.width) / width;
  const float step_y = static_cast<float>(frame.height) / height;
  small.colour.reserve(static_cast<std::size_t>(width) * height);
  // How much of pixel i lies between two borders.
  const auto share = [](int i, float low, float high) {
    return std::min(high, static_cast<float>(i + 1)) - std::max(low, static_cast<float>(i));
  };
  for (int y = 0; y < height; ++y) {
    const float top = y * step_y;
    const float bottom = std::min(top + step_y, static_cast<float>(frame.height));
    for (int x = 0; x < width; ++x) {
      const float left = x * step_x;
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
        const float weight = across.weight[x][tap];
        for (std::size_t c = 0; c < channels; ++c)
          out[x * channels + c] += weight * in[row(at) + c];
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
        sum += down.weight[y][tap] * wide[static_cast<std::size_t>(at) * row(width) + i];
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
      return std::max(16, static_cast<int>(std::lround(side / options.enlarge)));
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
