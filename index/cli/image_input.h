// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// An image that was named on the command line; "-" is standard input.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "index/files/image_files.h"

namespace pliant::cli {

struct ImageInput {
  std::string name;  // for messages
  std::vector<std::uint8_t> bytes;
};

// The bytes of an image that DecodeImage reads, or refuses: binary PGM and PPM of 8 bits, which it
// does not know, come as PNG. Throws like ReadFile and, for a broken one of those, like
// DecodeImage.
ImageInput ReadImage(const std::filesystem::path& path, std::int64_t max_bytes);

// Calls `work`; errors that concern the image alone begin with its name.
template <typename Work>
auto Naming(const ImageInput& image, Work work) {
  try {
    return work();
  } catch (const Error& error) {
    if (!ConcernsOneImage(error.code())) throw;
    throw Error(error.code(), error.reason(), image.name + ": " + error.what());
  }
}

}  // namespace pliant::cli
