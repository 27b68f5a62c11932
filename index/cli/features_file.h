// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Features as a file, the format by its name:
//   .npz          NumPy's archive: arrays `keypoints` float32 N x 6 (x, y, size, angle, response,
//                 octave), `descriptors` float32 or uint8 N x D, and single values `width`,
//                 `height` (int64) and `model_id` (text). numpy.load(file)["keypoints"]
//   .safetensors  tensors `keypoints` and `descriptors` as above; metadata model_id, width, height
//                 (descriptor/base/safetensors.h)
//   -             standard output: as .npz
//   .h5, .hdf5    HDF5, as hloc has it: a group for each picture (index/cli/hdf5_file.h)
// Of a folder, but in HDF5: the rows of all pictures one after the other; `starts` int64 P + 1,
// where picture i has the rows starts[i] .. starts[i + 1]; `width` and `height` int64 P; `names`
// (text) P, which as metadata of .safetensors is a JSON list.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "descriptor/features/features.h"
#include "index/cli/folder_features.h"

namespace pliant::cli {

// Throws kInvalidArgument "bad_features_name" for another extension, and kNoSpace "write_failed"
// for what CheckWritable refuses; to be called before the work whose result is written.
void CheckFeaturesName(const std::filesystem::path& path);

// Replaces the file in one step. `name` is of the picture. Throws what CheckFeaturesName throws,
// and kNoSpace "write_failed".
void WriteFeatures(const std::filesystem::path& path, const std::string& name,
                   const Features& features);

// The same of several pictures, all described alike.
class FolderFeaturesFile {
 public:
  virtual ~FolderFeaturesFile() = default;
  // False: there is a picture of this name, or a folder, already. HDF5 is written as pictures come;
  // the others keep all in memory.
  virtual bool Add(FolderPicture picture) = 0;
  // Replaces the file. What is not published leaves nothing.
  virtual void Publish() = 0;
};
std::unique_ptr<FolderFeaturesFile> OpenFolderFeatures(const std::filesystem::path& path);

}  // namespace pliant::cli
