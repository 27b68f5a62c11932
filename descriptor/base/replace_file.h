// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

namespace pliant {

// Writes all bytes at an offset of an open file. Returns the system's error.
[[nodiscard]] std::error_code WriteAt(int fd, std::uint64_t offset, std::string_view bytes);

// Replaces the file at `path` by `parts`, one after the other: written to a temporary file beside
// it, flushed to the disk, then renamed, so that a reader or a power loss sees the old file or the
// whole new one. Returns the system's error, with `path` untouched and no temporary file left;
// callers convert it to their own Error. Thread-safe for different paths.
[[nodiscard]] std::error_code ReplaceFile(const std::filesystem::path& path,
                                          std::span<const std::string_view> parts);

// The name of the temporary file, for callers that write it themselves.
std::string TemporaryNameOf(const std::filesystem::path& path);
// The second step of ReplaceFile: flushes and renames the temporary file. On failure the file
// stays.
[[nodiscard]] std::error_code PublishFile(const std::string& temporary,
                                          const std::filesystem::path& path);

}  // namespace pliant
