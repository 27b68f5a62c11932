// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Small images and folders for the tests of the index.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <unistd.h>

#include "descriptor/image/image.h"

namespace pliant::testing {

// A folder that is gone with the object.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "pliant-test-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

// A grey image of random discs: full of keypoints, unlike that of any other seed.
inline Image RandomImage(std::uint64_t seed, int width = 160, int height = 120) {
  std::mt19937_64 random(seed);
  Image image{width, height, 1, {}};
  image.pixels.assign(static_cast<std::size_t>(width) * height, 128);
  for (int disc = 0; disc < 90; ++disc) {
    const int cx = static_cast<int>(random() % width);
    const int cy = static_cast<int>(random() % height);
    const int radius = 2 + static_cast<int>(random() % 9);
    const auto grey = static_cast<std::uint8_t>(random() % 256);
    for (int y = std::max(0, cy - radius); y < std::min(height, cy + radius); ++y) {
      for (int x = std::max(0, cx - radius); x < std::min(width, cx + radius); ++x) {
        if ((x - cx) * (x - cx) + (y - cy) * (y - cy) < radius * radius) {
          image.pixels[static_cast<std::size_t>(y) * width + x] = grey;
        }
      }
    }
  }
  return image;
}

inline std::vector<std::uint8_t> RandomPng(std::uint64_t seed) {
  return EncodePng(RandomImage(seed));
}

// The same scene, seen a little brighter and shifted.
inline std::vector<std::uint8_t> OtherViewPng(std::uint64_t seed) {
  const Image image = RandomImage(seed);
  Image view{image.width, image.height, 1, {}};
  view.pixels.assign(image.pixels.size(), 128);
  for (int y = 0; y + 3 < image.height; ++y) {
    for (int x = 0; x + 5 < image.width; ++x) {
      const int value = image.pixels[static_cast<std::size_t>(y) * image.width + x] * 9 / 10 + 20;
      view.pixels[static_cast<std::size_t>(y + 3) * image.width + x + 5] =
          static_cast<std::uint8_t>(std::min(255, value));
    }
  }
  return EncodePng(view);
}

// A copy with noise of its own for each seed.
inline std::vector<std::uint8_t> NoisyPng(Image image, std::uint64_t noise_seed) {
  std::mt19937_64 random(noise_seed);
  for (std::uint8_t& pixel : image.pixels) {
    const int value = pixel + static_cast<int>(random() % 25) - 12;
    pixel = static_cast<std::uint8_t>(std::clamp(value, 0, 255));
  }
  return EncodePng(image);
}

inline void WriteBytes(const std::filesystem::path& path, const std::vector<std::uint8_t>& bytes) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

inline void WriteText(const std::filesystem::path& path, const std::string& text) {
  WriteBytes(path, {text.begin(), text.end()});
}

inline std::vector<std::uint8_t> ReadBytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace pliant::testing
