// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the system says when a file of the server cannot be written or read, as Error.
#pragma once

#include <cstdint>
#include <filesystem>

namespace pliant::server {

// By errno: kNoSpace "no_space", kReadOnly "read_only", kUnavailable "too_many_open_files",
// kInternal "io_error".
[[noreturn]] void ThrowFileError(const std::filesystem::path& path, int number);

// Throws kNoSpace "no_space" unless `bytes` fit on the disk of the directory and leave `reserve`
// bytes free.
void RequireDiskSpace(const std::filesystem::path& directory, std::uint64_t bytes,
                      std::uint64_t reserve);

}  // namespace pliant::server
