// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/picture_input.h"

#include <array>
#include <cerrno>
#include <cstdio>
#include <system_error>

#include "index/files/text.h"

namespace pliant::cli {
namespace {

std::vector<std::uint8_t> ReadStandardInput(std::int64_t max_bytes) {
  std::vector<std::uint8_t> bytes;
  std::array<std::uint8_t, 65536> piece{};
  std::size_t count = 0;
  while ((count = std::fread(piece.data(), 1, piece.size(), stdin)) > 0) {
    if (bytes.size() + count > static_cast<std::uint64_t>(max_bytes)) {
      throw Error(ErrorCode::kTooLarge, "image_too_large",
                  "standard input has more than " + std::to_string(max_bytes) +
                      " bytes, which is the limit");
    }
    bytes.insert(bytes.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(count));
  }
  if (std::ferror(stdin) != 0) {
    throw Error(ErrorCode::kNotFound, "cannot_read",
                "standard input cannot be read: " + std::generic_category().message(errno));
  }
  return bytes;
}

}  // namespace

PictureInput ReadPicture(const std::filesystem::path& path, std::int64_t max_bytes) {
  if (path == "-") return {"standard input", ReadStandardInput(max_bytes)};
  return {ToDisplayText(path.string()), ReadFile(path, max_bytes)};
}

}  // namespace pliant::cli
