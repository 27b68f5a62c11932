// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A file as memory.
#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

namespace pliant {

// The whole file, which the system reads on access; valid as long as the result lives. Not through
// a link. Throws what ThrowErrno throws (index/files/durable_file.h).
std::shared_ptr<const std::string_view> MapFile(const std::filesystem::path& path);

}  // namespace pliant
