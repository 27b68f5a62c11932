// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where textures come from: a folder of images, a safetensors pack, or the procedural generator.
#pragma once

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

#include "descriptor/image/image.h"
#include "descriptor/simulation/texture.h"

namespace pliant::simulation {

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

// Every regular file below a folder, in the order of their relative paths, which become the
// textures' names; or the tensors of a safetensors pack (U8, [H, W] or [H, W, 3]) in the order of
// their names. What cannot be decoded is skipped and listed. `jobs` threads decode (0 = one per
// core). Throws Error: kNotFound "textures_not_found", kInvalidArgument "textures_missing" when
// nothing usable is there, kCorrupt for a broken pack.
TextureSource LoadTextures(const std::filesystem::path& where, const ImageDecoder& decoder,
                           int jobs, std::vector<SkippedFile>& skipped);

}  // namespace pliant::simulation
