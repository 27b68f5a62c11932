// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Keypoints and matches in a database of COLMAP (Schönberger and Frahm, CVPR 2016), as its version
// 3.8 makes them; later versions read them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "descriptor/warp/tps.h"

namespace pliant {

struct ColmapImage {
  std::string name;  // the file below COLMAP's image_path, with slashes
  int width = 0;     // of the file's rows of pixels, which COLMAP does not turn upright
  int height = 0;
  std::span<const Vec2> points;  // in these pixels, pixel centres at integers
};

// A pair of points: of the first image, of the second.
using PointNumbers = std::pair<std::uint32_t, std::uint32_t>;

// Used by one thread at a time.
class ColmapDatabase {
 public:
  virtual ~ColmapDatabase() = default;  // without Publish, no file is left

  // Returns the image's number, from 1. Its camera has COLMAP's model SIMPLE_RADIAL and COLMAP's
  // default focal length, 1.2 times the longer side, which COLMAP refines.
  virtual int AddImage(const ColmapImage& image) = 0;
  // Once per pair. A pair without matches is stored too, so that COLMAP does not match it itself.
  virtual void AddMatches(int first, int second, std::span<const PointNumbers> matches) = 0;
  // Gives the file its name. Throws kConflict "file_exists" if that exists by now.
  virtual void Publish() = 0;
};

// `one_camera`: all images were taken by one camera, with one focal length; then they must have
// one size: kInvalidArgument "sizes_vary". Throws kConflict "file_exists", kNotFound
// "no_such_directory", and what a full disk throws.
std::unique_ptr<ColmapDatabase> CreateColmapDatabase(const std::filesystem::path& file,
                                                     bool one_camera);

}  // namespace pliant
