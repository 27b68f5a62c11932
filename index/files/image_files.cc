// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/image_files.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include <sys/stat.h>

#include "descriptor/base/error.h"
#include "descriptor/base/format_bytes.h"
#include "descriptor/base/strings.h"
#include "descriptor/image/image.h"
#include "index/files/durable_file.h"
#include "index/files/text.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

// Names that promise an image, also of types that Pliant does not read: those are reported.
constexpr std::array<std::string_view, 19> kImageExtensions = {
    ".jpg", ".jpeg", ".jpe",  ".jfif", ".png", ".webp", ".bmp", ".dib", ".tif", ".tiff",
    ".gif", ".heic", ".heif", ".avif", ".jp2", ".jxl",  ".pgm", ".ppm", ".pnm"};

// Of Synology, QNAP, NetApp, Windows, macOS and disk checks. server/web/incoming.js has the same.
constexpr std::array<std::string_view, 10> kSystemFolders = {"@eadir",
                                                             "#recycle",
                                                             "#snapshot",
                                                             "@recycle",
                                                             "@recently-snapshot",
                                                             "~snapshot",
                                                             "$recycle.bin",
                                                             "system volume information",
                                                             "__macosx",
                                                             "lost+found"};

bool HasImageName(const fs::path& path) {
  const std::string extension = Lower(path.extension().string());
  return std::find(kImageExtensions.begin(), kImageExtensions.end(), extension) !=
         kImageExtensions.end();
}

bool HasImageContent(const fs::path& path) {
  std::array<std::uint8_t, 64> start{};
  std::ifstream file(path, std::ios::binary);
  if (!file && FilesAreUsedUp()) ThrowOutOfFiles("cannot read " + path.string());
  file.read(reinterpret_cast<char*>(start.data()), start.size());
  const auto got = static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0));
  return SniffFormat(Bytes(start).first(got)) != ImageFormat::kUnknown;
}

class Walk {
 public:
  void Visit(const fs::path& path, int depth, const fs::path& below = {}, bool is_link = false) {
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    if (fs::is_directory(status)) {
      if (depth > 0 && IsSystemFolder(path.filename().native())) {
        CountFiles(path);
      } else {
        VisitFolder(path, depth, depth == 0 ? below : below / path.filename());
      }
    } else if (fs::is_regular_file(status)) {
      if (depth > 0 && !LooksLikeImage(path)) return;
      if (IsNew(path) || !is_link) found.push_back({path, depth, below});
    } else if (depth == 0) {
      throw Error(ErrorCode::kNotFound, "input_not_found",
                  path.string() + " is neither a folder nor a file" +
                      (error ? " (" + error.message() + ")" : ""));
    } else if (HasImageName(path)) {
      skipped.push_back({ToDisplayText(path.string()), "cannot_read",
                         error ? error.message() : "it is neither a folder nor a file"});
    }
  }

  void FollowLinks() {
    for (const bool folders : {true, false}) {
      for (std::size_t i = 0; i < links_.size(); ++i) {  // a linked folder can have more links
        const auto [path, depth, below] = links_[i];
        std::error_code error;
        if (fs::is_directory(path, error) == folders) Visit(path, depth, below, true);
      }
    }
  }

  struct Found {
    fs::path path;
    int depth;       // 0 = named itself, 1 = directly in a named folder
    fs::path below;  // the way to its folder from there; empty for these
  };
  std::vector<Found> found;
  std::vector<SkippedFile> skipped;
  std::uint64_t system_files = 0;

 private:
  bool IsNew(const fs::path& path) {
    struct stat info = {};
    return ::stat(path.c_str(), &info) == 0 && visited_.emplace(info.st_dev, info.st_ino).second;
  }

  void CountFiles(const fs::path& folder) {
    std::error_code error;
    fs::recursive_directory_iterator it(folder, fs::directory_options::skip_permission_denied,
                                        error);
    for (; !error && it != fs::recursive_directory_iterator(); it.increment(error)) {
      std::error_code unknown;
      if (it->is_regular_file(unknown) && !it->is_symlink(unknown)) ++system_files;
    }
  }

  void VisitFolder(const fs::path& folder, int depth, const fs::path& below) {
    if (!IsNew(folder)) return;
    std::vector<fs::path> entries;
    std::error_code error;
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
      if (!it->path().filename().native().starts_with('.')) entries.push_back(it->path());
    }
    if (error && IsOutOfFiles(error.value())) ThrowOutOfFiles("cannot read " + folder.string());
    if (error) skipped.push_back({ToDisplayText(folder.string()), "cannot_read", error.message()});
    std::sort(entries.begin(), entries.end(),
              [](const fs::path& a, const fs::path& b) { return a.native() < b.native(); });
    for (const fs::path& entry : entries) {
      if (fs::is_symlink(entry, error)) {
        links_.push_back({entry, depth + 1, below});
      } else {
        Visit(entry, depth + 1, below);
      }
    }
  }

  std::set<std::pair<dev_t, ino_t>> visited_;
  std::vector<Found> links_;  // for FollowLinks()
};

std::string FolderName(const fs::path& path) {
  const fs::path folder = fs::absolute(path).lexically_normal().parent_path();
  return folder.filename().string();
}

std::string ObjectOf(const Walk::Found& found, ObjectFrom object_from) {
  switch (object_from) {
    case ObjectFrom::kStem:
      return ToDisplayText(found.path.stem().string());
    case ObjectFrom::kNone:
      return {};
    default:
      return ToDisplayText(found.below.empty() ? FolderName(found.path)
                                               : found.below.generic_string());
  }
}

}  // namespace

bool IsSystemFolder(std::string_view name) {
  return std::ranges::find(kSystemFolders, Lower(name)) != kSystemFolders.end();
}

bool LooksLikeImage(const fs::path& path) { return HasImageName(path) || HasImageContent(path); }

ImageFiles FindImages(const std::vector<fs::path>& inputs, ObjectFrom object_from) {
  Walk walk;
  for (const fs::path& input : inputs) walk.Visit(input, 0);
  walk.FollowLinks();
  ImageFiles files;
  files.system_files = walk.system_files;
  files.skipped = std::move(walk.skipped);
  const int outside = inputs.size() == 1 ? 1 : 0;  // the depth down to which images have no folder
  std::set<fs::path> seen;                         // a folder and a file in it may both be named
  for (const Walk::Found& found : walk.found) {
    if (!seen.insert(found.path).second) continue;
    ObjectFrom from = object_from;
    if (from == ObjectFrom::kAuto) {
      from = found.depth <= outside ? ObjectFrom::kStem : ObjectFrom::kFolder;
    }
    files.by_folder = files.by_folder || from == ObjectFrom::kFolder;
    files.by_stem = files.by_stem || from == ObjectFrom::kStem;
    files.images.push_back({found.path, ObjectOf(found, from)});
  }
  return files;
}

bool IsInside(const fs::path& directory, const fs::path& path) {
  return std::mismatch(directory.begin(), directory.end(), path.begin(), path.end()).first ==
         directory.end();
}

std::vector<std::uint8_t> ReadFile(const fs::path& path, std::int64_t max_bytes) {
  const auto fail = [&](const std::string& why) {
    throw Error(ErrorCode::kNotFound, "cannot_read", path.string() + " cannot be read: " + why);
  };
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (error) fail(error.message());
  if (!fs::is_regular_file(status)) fail("it is no regular file");
  std::ifstream file(path, std::ios::binary);
  if (!file && IsOutOfFiles(errno)) ThrowOutOfFiles(path.string() + " cannot be read");
  if (!file) fail(std::generic_category().message(errno));
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) fail(error.message());
  if (size > static_cast<std::uintmax_t>(max_bytes)) {
    throw Error(ErrorCode::kTooLarge, "image_too_large",
                path.string() + " is larger than " +
                    FormatBytes(static_cast<std::uint64_t>(max_bytes)) + ", which is the limit");
  }
  std::vector<std::uint8_t> bytes(size);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (file.bad()) fail(std::generic_category().message(errno));
  bytes.resize(static_cast<std::size_t>(file.gcount()));  // it may have shrunk meanwhile
  return bytes;
}

bool ConcernsOneImage(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUnsupportedMediaType:
    case ErrorCode::kTooLarge:
    case ErrorCode::kUnprocessable:
    case ErrorCode::kInvalidArgument:
      return true;
    default:
      return false;
  }
}

bool ConcernsOneImage(const Error& error) {
  return error.reason() == "same_bytes" || ConcernsOneImage(error.code());
}

}  // namespace pliant
