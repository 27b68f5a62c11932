// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/durable_file.h"

#include <array>
#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include "descriptor/base/error.h"

namespace pliant {

namespace fs = std::filesystem;

std::string DisplayPath(const fs::path& path) { return path.string(); }

bool IsOutOfFiles(int code) { return code == EMFILE || code == ENFILE; }

bool FilesAreUsedUp() {
  std::array<int, 4>
      files{};  // a database has a log and an index of it, and its directory is flushed
  std::size_t opened = 0;
  int code = 0;
  while (opened < files.size() && code == 0) {
    const int file = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (file >= 0) {
      files[opened++] = file;
    } else {
      code = errno;
    }
  }
  for (std::size_t i = 0; i < opened; ++i) ::close(files[i]);
  return IsOutOfFiles(code);
}

void ThrowOutOfFiles(const std::string& doing) {
  throw Error(ErrorCode::kUnavailable, "too_many_open_files",
              doing +
                  ": too many files are open; allow more (ulimit -n, LimitNOFILE of a service) or "
                  "fewer connections and threads");
}

void ThrowErrno(const std::string& doing, const fs::path& path) {
  const int code = errno;
  const std::string message =
      doing + " " + DisplayPath(path) + ": " + std::generic_category().message(code);
  switch (code) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      throw Error(ErrorCode::kNoSpace, "write_failed", message);
    case EACCES:
    case EPERM:
      throw Error(ErrorCode::kReadOnly, "permission_denied", message);
    case EROFS:
      throw Error(ErrorCode::kReadOnly, "read_only_file_system", message);
    case EMFILE:
    case ENFILE:
      ThrowOutOfFiles(doing + " " + DisplayPath(path));
    default:
      throw Error(ErrorCode::kInternal, "io_error", message);
  }
}

void SyncPath(const fs::path& path, int flags) {
  const int fd = ::open(path.c_str(), flags | O_CLOEXEC);
  if (fd < 0) ThrowErrno("cannot open", path);
  const int status = ::fsync(fd);
  const int code = errno;
  ::close(fd);
  errno = code;
  if (status != 0) ThrowErrno("cannot flush", path);
}

void SyncDirectoryOf(const fs::path& path) {
  SyncPath(fs::absolute(path).parent_path(), O_RDONLY | O_DIRECTORY);
}

void CheckParentDirectory(const fs::path& path) {
  const fs::path parent = fs::absolute(path).parent_path();
  std::error_code ignored;
  if (!fs::is_directory(parent, ignored)) {
    throw Error(ErrorCode::kNotFound, "no_such_directory",
                "the directory " + DisplayPath(parent) + " does not exist; make it first");
  }
}

}  // namespace pliant
