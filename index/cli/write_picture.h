// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "descriptor/image/image.h"

namespace pliant::cli {

// PNG or JPEG, as the name says. Throws kInvalidArgument "bad_picture_name" for another name; to be
// called before the work whose result the picture is.
void CheckPictureName(const std::filesystem::path& file);

// Replaces the file in one step. Throws what CheckPictureName and WriteFile throw.
void WritePicture(const std::filesystem::path& file, const Image& picture);

}  // namespace pliant::cli
