// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/write_file.h"

#include <cctype>
#include <cerrno>
#include <fstream>
#include <iostream>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "descriptor/base/replace_file.h"
#include "index/cli/output.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

bool IsJpeg(const std::filesystem::path& file) {
  return file.extension() == ".jpg" || file.extension() == ".jpeg";
}

[[noreturn]] void FailToWrite(const std::filesystem::path& path, const std::string& why) {
  throw Error(ErrorCode::kNoSpace, "write_failed", path.string() + why);
}

}  // namespace

void WriteFile(const std::filesystem::path& path, std::string_view content) {
  if (path == kStandardOutput) {
    std::cout.write(content.data(), static_cast<std::streamsize>(content.size()));
    return;  // FlushOutput says whether it was possible
  }
  if (const std::error_code error = ReplaceFile(path, {&content, 1})) {
    FailToWrite(path, " could not be written: " + error.message());
  }
}

void CheckWritable(const std::filesystem::path& path) {
  if (path == kStandardOutput) return;
  std::error_code ignored;
  bool writable = false;
  if (!std::filesystem::is_directory(path, ignored)) {
    const std::filesystem::path temporary = TemporaryNameOf(path);
    writable = std::ofstream(temporary, std::ios::binary | std::ios::trunc).is_open();
    std::filesystem::remove(temporary, ignored);
  }
  if (!writable)
    FailToWrite(path, " cannot be written; check that the folder exists and is writable");
}

void CheckOutput(const std::filesystem::path& path, std::string_view flag, bool json) {
  if (path == kStandardOutput) ClaimStandardOutput(flag, json);
  if (!path.empty()) CheckWritable(path);
}

void CheckFolderName(const std::filesystem::path& folder, std::string_view file) {
  // "run.2" may be meant; "o.gif" is not.
  const std::string extension = folder.extension().string();
  const bool promises =
      extension.size() > 1 && std::isalpha(static_cast<unsigned char>(extension[1])) != 0;
  std::error_code ignored;
  if (!promises || std::filesystem::is_directory(folder, ignored)) return;
  throw Error(ErrorCode::kInvalidArgument, "bad_folder_name",
              fmt::format("{}: cannot write {} files; give {} or a folder for images; end the name "
                          "of such a folder with a slash",
                          PathText(folder), ToDisplayText(extension), file));
}

void CheckNotInput(const std::filesystem::path& path,
                   std::initializer_list<std::filesystem::path> inputs) {
  for (const std::filesystem::path& input : inputs) {
    std::error_code ignored;  // then one of them does not exist
    if (!std::filesystem::equivalent(path, input, ignored)) continue;
    throw Error(ErrorCode::kInvalidArgument, "same_file",
                PathText(path) + " is an input and would be overwritten; give another file");
  }
}

NewFile::NewFile(std::filesystem::path path)
    : path_(std::move(path)),
      temporary_(TemporaryNameOf(path_)),
      file_(::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)) {
  if (!file_.is_open()) Fail(std::generic_category().message(errno));
}

NewFile::~NewFile() {
  if (file_.is_open()) ::unlink(temporary_.c_str());
}

void NewFile::Fail(const std::string& why) const {
  FailToWrite(path_, " could not be written: " + why);
}

void NewFile::Write(std::uint64_t offset, std::string_view bytes) {
  if (const std::error_code error = WriteAt(file_.get(), offset, bytes)) Fail(error.message());
}

void NewFile::Publish() {
  if (const std::error_code error = PublishFile(temporary_, path_)) Fail(error.message());
  file_.Close();
}

bool IsImageName(const std::filesystem::path& file) {
  return file.extension() == ".png" || IsJpeg(file) || file == kStandardOutput;
}

void CheckImageOutput(const std::filesystem::path& file, std::string_view flag, bool json) {
  if (!file.empty() && !IsImageName(file)) {
    throw Error(ErrorCode::kInvalidArgument, "bad_image_name",
                file.string() + " must end in .png or .jpg, or be - for standard output");
  }
  CheckOutput(file, flag, json);
}

void WriteImage(const std::filesystem::path& file, const Image& image) {
  const std::vector<std::uint8_t> bytes = IsJpeg(file) ? EncodeJpeg(image) : EncodePng(image);
  WriteFile(file, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

}  // namespace pliant::cli
