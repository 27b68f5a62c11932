// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An image as a texture: linear light, mip-mapped, bilinear.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "descriptor/image/image.h"

namespace pliant::simulation {

// Linear R, G, B; the fourth value is padding, so that a colour is one vector register.
using Colour = Eigen::Array4f;

// A value of 0..255 (clamped) to the nearest byte.
inline std::uint8_t ToByte(float value) {
  return static_cast<std::uint8_t>(std::clamp(value + 0.5F, 0.0F, 255.0F));
}

// Width and height of an image of this height / width whose longer side is `side_px`.
std::pair<int, int> FitSide(int side_px, float aspect);

// sRGB code value 0..255 to linear light 0..1.
float LinearFromSrgb(std::uint8_t code);

class Texture {
 public:
  // `image` has 1 or 3 channels.
  Texture(std::string name, const Image& image);

  const std::string& name() const { return name_; }
  int width() const { return levels_.front().width; }
  int height() const { return levels_.front().height; }
  float aspect() const { return static_cast<float>(height()) / width(); }

  // The colour at u, v in [0, 1] (clamped), blended between the two mip levels around `lod`
  // (0 = full resolution; each level halves it).
  Colour Sample(float u, float v, float lod) const;

 private:
  struct Level {
    int width = 0;
    int height = 0;
    std::vector<Colour> texels;
  };
  static Level Halve(const Level& level);
  static Colour Bilinear(const Level& level, float u, float v);

  std::string name_;
  std::vector<Level> levels_;
};

// Images by number, 8 bits a channel; expanded to mip-mapped textures on demand, of which the
// last few are kept. Thread-safe once filled.
class TextureSource {
 public:
  void Add(std::string name, Image image);
  std::size_t size() const { return entries_.size(); }
  const std::string& name(std::size_t i) const { return entries_[i].name; }
  std::shared_ptr<const Texture> Get(std::size_t i) const;

 private:
  struct Entry {
    std::string name;
    Image image;
  };
  static constexpr std::size_t kKept = 32;

  std::vector<Entry> entries_;
  mutable std::unique_ptr<std::mutex> mutex_ = std::make_unique<std::mutex>();  // guards kept_
  mutable std::list<std::pair<std::size_t, std::shared_ptr<const Texture>>> kept_;
};

struct SkippedFile {
  std::string file;
  std::string reason;
};

// File bytes to an image; throws Error.
using ImageDecoder = std::function<Image(std::span<const std::uint8_t>)>;

// Binary PGM (P5) and PPM (P6), 8 bits. Throws Error kUnsupportedMediaType "image_type_unknown",
// kUnprocessable "image_corrupt" or "image_truncated".
Image DecodePnm(std::span<const std::uint8_t> bytes);

// Every regular file below a folder, in the order of their relative paths, which are the textures'
// names; or the tensors of a safetensors pack (U8, [H, W] or [H, W, 3]) in the order of their
// names. Files that cannot be decoded are skipped and listed. `jobs` threads decode (0 = one per
// core). Throws Error: kNotFound "textures_not_found", kInvalidArgument "textures_missing" when
// nothing usable is there, kCorrupt for a broken pack.
TextureSource LoadTextures(const std::filesystem::path& where, const ImageDecoder& decoder,
                           int jobs, std::vector<SkippedFile>& skipped);

// Bilinear between the cells of a grid, clamped to its border.
template <typename Value>
Value SampleGrid(const std::vector<Value>& grid, int columns, int rows, float x, float y) {
  x = std::clamp(x, 0.0F, static_cast<float>(columns - 1));
  y = std::clamp(y, 0.0F, static_cast<float>(rows - 1));
  const int x0 = std::min(static_cast<int>(x), columns - 2);
  const int y0 = std::min(static_cast<int>(y), rows - 2);
  const Value* row = grid.data() + static_cast<std::ptrdiff_t>(y0) * columns + x0;
  const Value top = row[0] + (x - x0) * (row[1] - row[0]);
  row += columns;
  const Value bottom = row[0] + (x - x0) * (row[1] - row[0]);
  return top + (y - y0) * (bottom - top);
}

}  // namespace pliant::simulation
