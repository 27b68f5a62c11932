// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/texture_source.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <fstream>
#include <optional>
#include <system_error>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/safetensors.h"

namespace pliant::simulation {
namespace {

namespace fs = std::filesystem;

constexpr int kMinSide = 16;

std::vector<std::uint8_t> ReadBytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(ErrorCode::kNotFound, "file_unreadable", "cannot read " + path.string());
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// The numbers of a PNM header, with comments between them.
class PnmHeader {
 public:
  explicit PnmHeader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  int Number() {
    SkipSpace();
    const std::size_t begin = at_;
    while (at_ < bytes_.size() && std::isdigit(bytes_[at_]) != 0) ++at_;
    int value = 0;
    const auto* text = reinterpret_cast<const char*>(bytes_.data());
    const auto parsed = std::from_chars(text + begin, text + at_, value);
    if (parsed.ec != std::errc() || begin == at_) {
      throw Error(ErrorCode::kUnprocessable, "image_corrupt", "broken PNM header");
    }
    return value;
  }
  // One white space byte ends the header.
  std::size_t PixelsBegin() const { return at_ + 1; }

 private:
  void SkipSpace() {
    while (at_ < bytes_.size() && (std::isspace(bytes_[at_]) != 0 || bytes_[at_] == '#')) {
      if (bytes_[at_] == '#') {
        while (at_ < bytes_.size() && bytes_[at_] != '\n') ++at_;
      } else {
        ++at_;
      }
    }
  }
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 2;
};

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
  PnmHeader header(bytes);
  Image image;
  image.channels = bytes[1] == '5' ? 1 : 3;
  image.width = header.Number();
  image.height = header.Number();
  if (image.width < 1 || image.height < 1 || image.width > 30000 || image.height > 30000 ||
      header.Number() != 255) {
    throw Error(ErrorCode::kUnprocessable, "image_corrupt", "PNM size out of range, or not 8 bits");
  }
  const std::size_t size = static_cast<std::size_t>(image.width) *
                           static_cast<std::size_t>(image.height) *
                           static_cast<std::size_t>(image.channels);
  if (bytes.size() < header.PixelsBegin() + size) {
    throw Error(ErrorCode::kUnprocessable, "image_truncated", "the PNM image ends early");
  }
  const auto pixels = bytes.subspan(header.PixelsBegin(), size);
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
