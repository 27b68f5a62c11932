// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "descriptor/image/image.h"

namespace pliant::cli {

// PNG or JPEG, by file name; "-", standard output, is PNG. Throws kInvalidArgument
// "bad_picture_name" for another extension; to be called before the work whose result is written.
void CheckPictureName(const std::filesystem::path& file);

// Atomically replaces the file. Throws what CheckPictureName and WriteFile throw.
void WritePicture(const std::filesystem::path& file, const Image& picture);

}  // namespace pliant::cli
