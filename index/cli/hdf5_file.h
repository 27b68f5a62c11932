// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features of pictures as HDF5, as hloc (Hierarchical-Localization) keeps them: a group for each
// picture, by its name; a name with slashes is a group in groups. N key points, descriptors of D:
//   keypoints    float32 N x 2: x, y, pixels of the upright picture; centres at integers
//   descriptors  float32, or uint8 of binary ones, D x N: a COLUMN for each key point, as hloc has
//                it and its matchers take it (OpenCV, NumPy archives and Pliant have rows)
//   scores       float32 N: the detector's strength
//   scales       float32 N: sigma, pixels: half of OpenCV's size, as COLMAP has it
//   oris         float32 N: degrees
//   image_size   int64 2: width, height
// Attributes of the file, texts: `model_id`, which made the descriptors; `generator`, "Pliant 1.2".
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "descriptor/features/features.h"

namespace pliant::cli {

// Written to a temporary file beside it, a picture at a time; in its place by Publish(). What is
// not published leaves nothing. Used by one thread; HDF5 belongs to no other one meanwhile.
class Hdf5File {
 public:
  // Throws kNoSpace "write_failed", as all methods do.
  explicit Hdf5File(std::filesystem::path path);
  ~Hdf5File();

  // False: a picture, or a folder, of this name is there already.
  bool Add(const std::string& name, const Features& features);
  // The file at `path` is replaced.
  void Publish();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant::cli
