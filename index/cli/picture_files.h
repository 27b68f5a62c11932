// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which files below the given folders are pictures, and what they show.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pliant::cli {

enum class ObjectFrom {
  kAuto,    // kStem for a single folder without sub-folders that hold pictures, else kFolder
  kFolder,  // name of the folder that the picture lies in
  kStem,    // file name without its extension
  kNone,
};

struct PictureFile {
  std::filesystem::path path;
  std::string object;  // valid UTF-8; bytes that are none are written as \xHH
};

struct SkippedFile {
  std::string file;
  std::string code;  // stable word
  std::string reason;
};

struct PictureFiles {
  std::vector<PictureFile> pictures;
  std::vector<SkippedFile> skipped;  // folders that cannot be read
  ObjectFrom named_by = ObjectFrom::kFolder;
};

// Walks `inputs` (folders or files) in the order of their names, so that the result is the same on
// every machine. Links to folders are followed, each folder is visited once. Hidden files and
// folders are left out, and so are files that have neither a picture's name nor its content.
// Throws kNotFound for an input that does not exist.
PictureFiles FindPictures(const std::vector<std::filesystem::path>& inputs, ObjectFrom object_from);

}  // namespace pliant::cli
