// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/texture.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <system_error>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/safetensors.h"

namespace pliant::simulation {
namespace {

std::array<float, 256> MakeLinearTable() {
  std::array<float, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const float x = i / 255.0F;
    table[i] = x <= 0.04045F ? x / 12.92F : std::pow((x + 0.055F) / 1.055F, 2.4F);
  }
  return table;
}

namespace fs = std::filesystem;

constexpr int kMinSide = 16;

std::vector<std::uint8_t> ReadBytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(ErrorCode::kNotFound, "file_unreadable", "cannot read " + path.string());
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// The next number of a PNM header, after white space and comments; moves `at` behind it.
int HeaderNumber(std::span<const std::uint8_t> bytes, std::size_t& at) {
  bool comment = false;
  for (; at < bytes.size() && (comment || std::isspace(bytes[at]) != 0 || bytes[at] == '#'); ++at)
    comment = bytes[at] == '#' || (comment && bytes[at] != '\n');
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  int value = 0;
  const auto parsed = std::from_chars(text + at, text + bytes.size(), value);
  if (parsed.ec != std::errc()) {
    throw Error(ErrorCode::kUnprocessable, "image_corrupt", "broken PNM header");
  }
  at = static_cast<std::size_t>(parsed.ptr - text);
  return value;
}

void CheckUsable(const Image& image) {
  if (std::min(image.width, image.height) < kMinSide) {
    throw Error(ErrorCode::kUnprocessable, "image_too_small", "smaller than 16 pixels");
  }
}

TextureSource LoadFolder(const fs::path& folder, const ImageDecoder& decoder, int jobs,
                         std::vector<SkippedFile>& skipped) {
  std::vector<fs::path> files;
  std::error_code failed;
  auto it = fs::recursive_directory_iterator(folder, failed);
  for (; !failed && it != fs::recursive_directory_iterator(); it.increment(failed)) {
    if (it->is_regular_file() && it->path().filename().string().front() != '.')
      files.push_back(it->path());
  }
  if (failed) {
    throw Error(ErrorCode::kNotFound, "textures_not_found",
                "cannot read the texture folder " + folder.string() + ": " + failed.message());
  }
  const auto name = [&folder](const fs::path& file) {
    return file.lexically_relative(folder).generic_string();
  };
  std::ranges::sort(files, {}, name);
  std::vector<Image> images(files.size());
  std::vector<std::string> reasons(files.size());
  ParallelFor(files.size(), jobs, [&](std::size_t i) {
    try {
      images[i] = decoder(ReadBytes(files[i]));
      CheckUsable(images[i]);
    } catch (const Error& error) {
      reasons[i] = error.what();
      images[i] = {};
    }
  });
  TextureSource source;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (images[i].empty()) {
      skipped.push_back({files[i].string(), reasons[i]});
    } else {
      source.Add(name(files[i]), std::move(images[i]));
    }
  }
  return source;
}

TextureSource LoadPack(const fs::path& path, std::vector<SkippedFile>& skipped) {
  TextureSource source;
  for (Tensor& tensor : ReadSafetensors(path)) {
    const std::size_t rank = tensor.shape.size();
    const bool grey = rank == 2;
    const bool colour = rank == 3 && tensor.shape[2] == 3;
    if (tensor.dtype != "U8" || (!grey && !colour)) {
      skipped.push_back({path.string() + ":" + tensor.name, "not a U8 tensor [H, W] or [H, W, 3]"});
      continue;
    }
    Image image{static_cast<int>(tensor.shape[1]), static_cast<int>(tensor.shape[0]), grey ? 1 : 3,
                std::move(tensor.bytes)};
    if (std::min(image.width, image.height) < kMinSide) {
      skipped.push_back({path.string() + ":" + tensor.name, "smaller than 16 pixels"});
      continue;
    }
    source.Add(tensor.name, std::move(image));
  }
  return source;
}

}  // namespace

std::pair<int, int> FitSide(int side_px, float aspect) {
  const auto side = static_cast<float>(side_px);
  return {static_cast<int>(std::lround(side * std::min(1.0F, 1.0F / aspect))),
          static_cast<int>(std::lround(side * std::min(1.0F, aspect)))};
}

float LinearFromSrgb(std::uint8_t code) {
  static const std::array<float, 256> table = MakeLinearTable();
  return table[code];
}

Texture::Texture(std::string name, const Image& image) : name_(std::move(name)) {
  Level base{image.width, image.height, {}};
  base.texels.reserve(static_cast<std::size_t>(image.width) * image.height);
  const auto channels = static_cast<std::size_t>(image.channels);
  for (std::size_t i = 0; i < image.pixels.size(); i += channels) {
    const float red = LinearFromSrgb(image.pixels[i]);
    const float green = channels == 3 ? LinearFromSrgb(image.pixels[i + 1]) : red;
    const float blue = channels == 3 ? LinearFromSrgb(image.pixels[i + 2]) : red;
    base.texels.emplace_back(red, green, blue, 0.0F);
  }
  levels_.push_back(std::move(base));
  while (levels_.back().width > 2 && levels_.back().height > 2)
    levels_.push_back(Halve(levels_.back()));
}

// Each texel of the half-size level averages the area it covers, also for odd sizes.
Texture::Level Texture::Halve(const Level& level) {
  Level half{level.width / 2, level.height / 2, {}};
  half.texels.reserve(static_cast<std::size_t>(half.width) * half.height);
  const auto at = [&level](int x, int y) -> const Colour& {
    return level.texels[static_cast<std::size_t>(std::min(y, level.height - 1)) * level.width +
                        std::min(x, level.width - 1)];
  };
  const auto sums = [&](int x, int y) {
    // Even sizes: the mean of two texels; odd ones: 1, 2, 1 around the middle one.
    const bool wide = level.width % 2 == 1;
    return wide ? Colour(0.25F * at(2 * x, y) + 0.5F * at(2 * x + 1, y) + 0.25F * at(2 * x + 2, y))
                : Colour(0.5F * (at(2 * x, y) + at(2 * x + 1, y)));
  };
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      if (level.height % 2 == 1) {
        half.texels.emplace_back(0.25F * sums(x, 2 * y) + 0.5F * sums(x, 2 * y + 1) +
                                 0.25F * sums(x, 2 * y + 2));
      } else {
        half.texels.emplace_back(0.5F * (sums(x, 2 * y) + sums(x, 2 * y + 1)));
      }
    }
  }
  return half;
}

Colour Texture::Bilinear(const Level& level, float u, float v) {
  const float x = std::clamp(u * level.width - 0.5F, 0.0F, static_cast<float>(level.width - 1));
  const float y = std::clamp(v * level.height - 0.5F, 0.0F, static_cast<float>(level.height - 1));
  const int x0 = static_cast<int>(x);
  const int y0 = static_cast<int>(y);
  const int step_x = x0 + 1 < level.width ? 1 : 0;
  const int step_y = y0 + 1 < level.height ? level.width : 0;
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const Colour* texel = level.texels.data() + static_cast<std::ptrdiff_t>(y0) * level.width + x0;
  const Colour top = texel[0] + fx * (texel[step_x] - texel[0]);
  const Colour bottom = texel[step_y] + fx * (texel[step_y + step_x] - texel[step_y]);
  return top + fy * (bottom - top);
}

Colour Texture::Sample(float u, float v, float lod) const {
  const auto last = static_cast<float>(levels_.size() - 1);
  const float level = std::clamp(lod, 0.0F, last);
  const auto lower = static_cast<std::size_t>(level);
  const float blend = level - lower;
  Colour fine = Bilinear(levels_[lower], u, v);
  if (blend < 0.02F || lower + 1 >= levels_.size()) return fine;
  return fine + blend * (Bilinear(levels_[lower + 1], u, v) - fine);
}

void TextureSource::Add(std::string name, Image image) {
  entries_.push_back({std::move(name), std::move(image)});
}

std::shared_ptr<const Texture> TextureSource::Get(std::size_t i) const {
  {
    const std::lock_guard lock(*mutex_);
    for (auto it = kept_.begin(); it != kept_.end(); ++it) {
      if (it->first != i) continue;
      kept_.splice(kept_.begin(), kept_, it);
      return kept_.front().second;
    }
  }
  // Expanded outside the lock; two threads may do it at once, with the same result.
  auto texture = std::make_shared<const Texture>(entries_[i].name, entries_[i].image);
  const std::lock_guard lock(*mutex_);
  kept_.emplace_front(i, texture);
  if (kept_.size() > kKept) kept_.pop_back();
  return texture;
}

Image DecodePnm(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 3 || bytes[0] != 'P' || (bytes[1] != '5' && bytes[1] != '6')) {
    throw Error(ErrorCode::kUnsupportedMediaType, "image_type_unknown",
                "not a binary PGM or PPM image");
  }
  std::size_t at = 2;
  Image image;
  image.channels = bytes[1] == '5' ? 1 : 3;
  image.width = HeaderNumber(bytes, at);
  image.height = HeaderNumber(bytes, at);
  if (image.width < 1 || image.height < 1 || image.width > 30000 || image.height > 30000 ||
      HeaderNumber(bytes, at) != 255) {
    throw Error(ErrorCode::kUnprocessable, "image_corrupt", "PNM size out of range, or not 8 bits");
  }
  const std::size_t size = static_cast<std::size_t>(image.width) * image.height * image.channels;
  ++at;  // one white space byte ends the header
  if (bytes.size() < at + size) {
    throw Error(ErrorCode::kUnprocessable, "image_truncated", "the PNM image ends early");
  }
  const auto pixels = bytes.subspan(at, size);
  image.pixels.assign(pixels.begin(), pixels.end());
  return image;
}

TextureSource LoadTextures(const fs::path& where, const ImageDecoder& decoder, int jobs,
                           std::vector<SkippedFile>& skipped) {
  std::error_code failed;
  const fs::file_status status = fs::status(where, failed);
  if (!fs::exists(status)) {
    throw Error(ErrorCode::kNotFound, "textures_not_found",
                "no such texture folder or pack: " + where.string());
  }
  TextureSource source = fs::is_directory(status) ? LoadFolder(where, decoder, jobs, skipped)
                                                  : LoadPack(where, skipped);
  if (source.size() == 0) {
    throw Error(ErrorCode::kInvalidArgument, "textures_missing",
                "no usable image in " + where.string() +
                    (skipped.empty() ? ""
                                     : " (first problem: " + skipped.front().file + ": " +
                                           skipped.front().reason + ")"));
  }
  return source;
}

}  // namespace pliant::simulation
