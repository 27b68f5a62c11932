// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The files of a TAR archive in memory: POSIX ustar with pax headers, and GNU's long names.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace pliant::server {

struct TarFile {
  std::string name;          // as stored, with its folders; may be any bytes
  std::string_view content;  // inside the archive
};

// Regular files alone, in their order; folders, links and devices are left out. Throws ProblemError
// "bad_request" that says at which byte for what is no archive, is damaged or ends too early, and
// "invalid_parameter" for more than `most` files.
std::vector<TarFile> ReadTar(std::string_view archive, std::size_t most);

}  // namespace pliant::server
