// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/write_file.h"

#include <fstream>
#include <string>
#include <system_error>

#include <unistd.h>

#include "descriptor/error.h"

namespace pliant::cli {

void WriteFile(const std::filesystem::path& path, std::span<const std::string_view> parts) {
  const std::filesystem::path temporary = path.string() + ".new-" + std::to_string(::getpid());
  std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
  for (const std::string_view part : parts)
    file.write(part.data(), static_cast<std::streamsize>(part.size()));
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(temporary, path, error);
  if (!file || error) {
    std::error_code ignored;  // the write's own error is the one to tell
    std::filesystem::remove(temporary, ignored);
    throw Error(ErrorCode::kNoSpace, "write_failed",
                path.string() + " could not be written" + (error ? ": " + error.message() : ""));
  }
}

void WriteFile(const std::filesystem::path& path, std::string_view content) {
  WriteFile(path, {&content, 1});
}

}  // namespace pliant::cli
