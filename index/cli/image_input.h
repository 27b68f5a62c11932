// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The images that a command line names: one ("-" is standard input), or a folder of them, which are
// described on all threads.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "descriptor/base/error.h"
#include "index/cli/interrupt.h"
#include "index/engine/engine.h"
#include "index/files/image_files.h"

namespace pliant::cli {

struct ImageInput {
  std::string name;  // for messages
  std::vector<std::uint8_t> bytes;
};

// The bytes of an image that DecodeImage reads, or refuses. Binary PGM and PPM of 8 bits, which it
// does not know, come as PNG. Throws like ReadFile and, for a broken PGM or PPM, like DecodeImage.
ImageInput ReadImage(const std::filesystem::path& path, std::int64_t max_bytes);

// Calls `work`; errors that concern this image alone, not an option, begin with its name.
template <typename Work>
auto Naming(const ImageInput& image, Work work) {
  try {
    return work();
  } catch (const Error& error) {
    if (!ConcernsOneImage(error.code()) || error.code() == ErrorCode::kInvalidArgument) throw;
    throw Error(error.code(), error.reason(), image.name + ": " + error.what());
  }
}

struct FolderImage {
  std::filesystem::path path;
  std::string name;  // below the root, with slashes
  Features features;
  int exif_orientation = 1;
};

struct FolderFeatures {
  std::filesystem::path root;  // the folder, or the deepest common one of all named images
  std::vector<FolderImage> images;
  std::vector<SkippedFile> skipped;  // by name below the root
};

// Finds the images of a folder, or takes the named images, in the order of their names. Leaves out
// the simulator's NAME.uv.png. Throws kNotFound for an input that does not exist.
FolderFeatures FindFolderImages(const std::vector<std::filesystem::path>& inputs);

// Describes them; images that cannot be described move to the skipped ones. `threads`: 0 = one per
// core, each with its own image. Ends early when interrupted. Throws for an invalid descriptor and
// when too many files are open.
void DescribeFolder(FolderFeatures& folder, const EngineOptions& engine, int threads,
                    const Interrupt& interrupt);

}  // namespace pliant::cli
