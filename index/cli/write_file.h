// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>

#include "descriptor/image/image.h"
#include "index/files/durable_file.h"

namespace pliant::cli {

// Replaces the file in one step (ReplaceFile); "-" is standard output (ClaimStandardOutput). Throws
// kNoSpace "write_failed".
void WriteFile(const std::filesystem::path& path, std::string_view content);

constexpr const char* kStandardOutput = "-";

// Throws kNoSpace "write_failed" if WriteFile would fail: the folder is missing or not writable, or
// the path is a folder. Call it before the work whose result is written.
void CheckWritable(const std::filesystem::path& path);
// The same for the value of an option; empty = no file. Reserves standard output for "-"
// (ClaimStandardOutput).
void CheckOutput(const std::filesystem::path& path, std::string_view flag, bool json);

// Throws kInvalidArgument "bad_folder_name" for the name of a folder for images that promises a
// file of a type that is not written (.gif). `file`: what else the option takes, for the message.
void CheckFolderName(const std::filesystem::path& folder, std::string_view file);

// Throws kInvalidArgument "same_file" if `path`, which is to be written, is one of the inputs
// (files or folders), under any name. Call it before any work.
void CheckNotInput(const std::filesystem::path& path,
                   std::initializer_list<std::filesystem::path> inputs);

// A file that is written in pieces, at any offset, and replaces the old one in one step (Publish).
// Without Publish, no file remains. Throws kNoSpace "write_failed".
class NewFile {
 public:
  explicit NewFile(std::filesystem::path path);
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  void Write(std::uint64_t offset, std::string_view bytes);
  void Publish();

 private:
  [[noreturn]] void Fail(const std::string& why) const;

  const std::filesystem::path path_;
  const std::string temporary_;
  FileHandle file_;
};

// Whether WriteImage takes the name: PNG or JPEG, by extension; "-", standard output, is PNG.
bool IsImageName(const std::filesystem::path& file);
// CheckOutput for an image. Throws kInvalidArgument "bad_image_name" for another extension.
void CheckImageOutput(const std::filesystem::path& file, std::string_view flag, bool json);

// Atomically replaces the file, whose name IsImageName. Throws what WriteFile throws.
void WriteImage(const std::filesystem::path& file, const Image& image);

}  // namespace pliant::cli
