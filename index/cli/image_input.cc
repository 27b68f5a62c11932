// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/image_input.h"

#include <array>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <system_error>

#include "descriptor/base/format_bytes.h"
#include "descriptor/image/image.h"
#include "descriptor/simulation/texture.h"
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
                  "standard input is larger than " +
                      FormatBytes(static_cast<std::uint64_t>(max_bytes)) + ", which is the limit");
    }
    bytes.insert(bytes.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(count));
  }
  if (std::ferror(stdin) != 0) {
    throw Error(ErrorCode::kNotFound, "cannot_read",
                "standard input cannot be read: " + std::generic_category().message(errno));
  }
  return bytes;
}

// Binary PGM and PPM, the formats of HPatches and other data sets, become PNG: the library reads
// what cameras and web sites make.
std::vector<std::uint8_t> AsPng(std::vector<std::uint8_t> bytes) {
  const bool pnm = bytes.size() > 2 && bytes[0] == 'P' && (bytes[1] == '5' || bytes[1] == '6') &&
                   (std::isspace(bytes[2]) != 0 || bytes[2] == '#');
  return pnm ? EncodePng(simulation::DecodePnm(bytes)) : bytes;
}

}  // namespace

ImageInput ReadImage(const std::filesystem::path& path, std::int64_t max_bytes) {
  const bool standard_input = path == "-";
  ImageInput image{standard_input ? "standard input" : ToDisplayText(path.string()),
                   standard_input ? ReadStandardInput(max_bytes) : ReadFile(path, max_bytes)};
  image.bytes = Naming(image, [&] { return AsPng(std::move(image.bytes)); });
  return image;
}

}  // namespace pliant::cli
