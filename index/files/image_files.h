// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Finds the image files below given folders, names their objects, and reads them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "descriptor/base/error.h"

namespace pliant {

enum class ObjectFrom {
  // kStem for a file that is given itself, and for files directly in the only given folder;
  // otherwise kFolder.
  kAuto,
  // The path of the image's folder relative to the given one ("coat/front"), so that folders of the
  // same name in different folders are different objects. Files directly in the given folder get
  // its name.
  kFolder,
  kStem,  // file name without its extension
  kNone,
};

struct ImageFile {
  std::filesystem::path path;
  std::string object;  // valid UTF-8; invalid bytes are written as \xHH
};

struct SkippedFile {
  std::string file;
  std::string code;  // stable word
  std::string reason;
};

struct ImageFiles {
  std::vector<ImageFile> images;
  std::vector<SkippedFile> skipped;  // folders that cannot be read
  std::uint64_t system_files = 0;    // left out: in folders that IsSystemFolder() names
  bool by_folder = false;            // some objects are named by their folder
  bool by_stem = false;
};

// Walks `inputs` (folders or files) in the order of their names, so that the result is the same on
// every machine. Links are followed last, and only to files and folders that the walk has not
// reached, so that a link names an object only if nothing else does; each folder is read once.
// Ignores hidden files and folders, and files with neither the name nor the content of an image,
// and counts the files of system folders. Throws kNotFound for an input that does not exist,
// kUnavailable "too_many_open_files".
ImageFiles FindImages(const std::vector<std::filesystem::path>& inputs, ObjectFrom object_from);

// Whether a folder of this name belongs to an operating system, a NAS or an archiver: its trash,
// thumbnails or snapshots. In any case of ASCII letters; hidden folders are not among them.
bool IsSystemFolder(std::string_view name);

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
// The same, or its bytes are already stored as another object.
bool ConcernsOneImage(const Error& error);

}  // namespace pliant
