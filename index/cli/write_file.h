// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string_view>

namespace pliant::cli {

// Replaces the file by the parts, one after the other, in one step. Throws kNoSpace "write_failed".
void WriteFile(const std::filesystem::path& path, std::span<const std::string_view> parts);
void WriteFile(const std::filesystem::path& path, std::string_view content);

}  // namespace pliant::cli
