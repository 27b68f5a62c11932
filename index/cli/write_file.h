// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

namespace pliant::cli {

// Replaces the file in one step (ReplaceFile). Throws kNoSpace "write_failed".
void WriteFile(const std::filesystem::path& path, std::string_view content);

// Throws kNoSpace "write_failed" if WriteFile would fail: the folder is missing or not writable, or
// the path is a folder. To be called before the work whose result is written.
void CheckWritable(const std::filesystem::path& path);

}  // namespace pliant::cli
