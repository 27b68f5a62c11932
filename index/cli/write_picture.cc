// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/write_picture.h"

#include <cstdint>
#include <string_view>
#include <vector>

#include "descriptor/base/error.h"
#include "index/cli/write_file.h"

namespace pliant::cli {
namespace {

bool IsJpeg(const std::filesystem::path& file) {
  return file.extension() == ".jpg" || file.extension() == ".jpeg";
}

}  // namespace

void CheckPictureName(const std::filesystem::path& file) {
  if (file.extension() == ".png" || IsJpeg(file) || file == kStandardOutput) return;
  throw Error(ErrorCode::kInvalidArgument, "bad_picture_name",
              file.string() + " must end in .png or .jpg, or be - for standard output");
}

void WritePicture(const std::filesystem::path& file, const Image& picture) {
  CheckPictureName(file);
  const std::vector<std::uint8_t> bytes = IsJpeg(file) ? EncodeJpeg(picture) : EncodePng(picture);
  WriteFile(file, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

}  // namespace pliant::cli
