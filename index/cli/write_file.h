// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

namespace pliant::cli {

// Replaces the file in one step (ReplaceFile). Throws kNoSpace "write_failed".
void WriteFile(const std::filesystem::path& path, std::string_view content);

// Throws kNoSpace "write_failed" where WriteFile could put no file: the folder is missing or may
// not be written, or the path is a folder's. To be called before the work whose result the file is.
void CheckWritable(const std::filesystem::path& path);

}  // namespace pliant::cli
