// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/write_file.h"

#include <fstream>
#include <string>
#include <system_error>

#include <unistd.h>

#include "descriptor/base/error.h"
#include "descriptor/base/replace_file.h"

namespace pliant::cli {
namespace {

std::filesystem::path TemporaryBeside(const std::filesystem::path& path) {
  return path.string() + ".new-" + std::to_string(::getpid());
}

}  // namespace

void WriteFile(const std::filesystem::path& path, std::string_view content) {
  if (const std::error_code error = ReplaceFile(path, {&content, 1})) {
    throw Error(ErrorCode::kNoSpace, "write_failed",
                path.string() + " could not be written: " + error.message());
  }
}

void CheckWritable(const std::filesystem::path& path) {
  std::error_code ignored;
  bool writable = false;
  if (!std::filesystem::is_directory(path, ignored)) {
    const std::filesystem::path temporary = TemporaryBeside(path);
    writable = std::ofstream(temporary, std::ios::binary | std::ios::trunc).is_open();
    std::filesystem::remove(temporary, ignored);
  }
  if (writable) return;
  throw Error(ErrorCode::kNoSpace, "write_failed",
              path.string() + " cannot be written; is the folder there and writable?");
}

}  // namespace pliant::cli
