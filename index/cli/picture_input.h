// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A picture that was named on the command line; "-" is standard input.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "index/files/picture_files.h"

namespace pliant::cli {

struct PictureInput {
  std::string name;  // for messages
  std::vector<std::uint8_t> bytes;
};

// The bytes of a picture that DecodeImage reads, or refuses: binary PGM and PPM of 8 bits, which it
// does not know, come as PNG. Throws like ReadFile and, for a broken one of those, like
// DecodeImage.
PictureInput ReadPicture(const std::filesystem::path& path, std::int64_t max_bytes);

// Calls `work`; errors that concern the picture alone begin with its name.
template <typename Work>
auto Naming(const PictureInput& picture, Work work) {
  try {
    return work();
  } catch (const Error& error) {
    if (!ConcernsOnePicture(error.code())) throw;
    throw Error(error.code(), error.reason(), picture.name + ": " + error.what());
  }
}

}  // namespace pliant::cli
