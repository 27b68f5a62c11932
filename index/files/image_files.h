// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Finds the image files below given folders, names their objects, and reads them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "descriptor/base/error.h"

namespace pliant {

enum class ObjectFrom {
  // kStem for a file that is given itself, and for what lies directly in a folder that is given
  // alone; else kFolder.
  kAuto,
  // The way to the image's folder from the one that was given ("coat/front"), so that folders of
  // one name in different places are different objects; what lies directly in it has its name.
  kFolder,
  kStem,  // file name without its extension
  kNone,
};

struct ImageFile {
  std::filesystem::path path;
  std::string object;  // valid UTF-8; bytes that are none are written as \xHH
};

struct SkippedFile {
  std::string file;
  std::string code;  // stable word
  std::string reason;
};

struct ImageFiles {
  std::vector<ImageFile> images;
  std::vector<SkippedFile> skipped;  // folders that cannot be read
  bool by_folder = false;            // some are named so
  bool by_stem = false;
};

// Walks `inputs` (folders or files) in the order of their names, so that the result is the same on
// every machine. Links to folders are followed, each folder is visited once. Hidden files and
// folders are ignored, and so are files that have neither an image's name nor its content.
// Throws kNotFound for an input that does not exist, kUnavailable "too_many_open_files".
ImageFiles FindImages(const std::vector<std::filesystem::path>& inputs, ObjectFrom object_from);

// Whether `path` is `directory` or below it. Both as fs::canonical gives them.
bool IsInside(const std::filesystem::path& directory, const std::filesystem::path& path);

// Whether a regular file has an image's name (of any type, also one that Pliant does not read:
// such a file is then refused with a reason instead of being overlooked) or an image's content.
bool LooksLikeImage(const std::filesystem::path& path);

// The whole file. Throws kNotFound "cannot_read", kTooLarge "image_too_large" above `max_bytes`,
// kUnavailable "too_many_open_files".
std::vector<std::uint8_t> ReadFile(const std::filesystem::path& path, std::int64_t max_bytes);

// Whether an error affects only one image (unreadable, not an image, too few features), so that
// the job can continue without it, rather than all (disk full, database busy, model mismatch).
bool ConcernsOneImage(ErrorCode code);
// The same, or its bytes are stored already as another object.
bool ConcernsOneImage(const Error& error);

}  // namespace pliant
