// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/durable_file.h"

#include <array>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "descriptor/base/format_bytes.h"

namespace pliant {

namespace fs = std::filesystem;

void FileHandle::Close() noexcept {
  const int code = errno;
  if (fd_ >= 0) ::close(std::exchange(fd_, -1));
  errno = code;
}

FileHandle MakeLockedFile(const std::function<fs::path()>& next_name, int mode, fs::path* path) {
  while (true) {
    *path = next_name();
    FileHandle file(::open(path->c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, mode));
    if (!file.is_open() && errno == EEXIST) continue;
    if (!file.is_open()) ThrowErrno("cannot make", *path);
    struct stat info = {};
    if (::flock(file.get(), LOCK_EX) != 0 || ::fstat(file.get(), &info) != 0) {
      const int code = errno;
      ::unlink(path->c_str());
      ThrowErrno("cannot lock", *path, code);
    }
    if (info.st_nlink > 0) return file;
  }
}

bool IsSameFile(int fd, const fs::path& path) {
  struct stat held = {};
  struct stat named = {};
  return ::fstat(fd, &held) == 0 && ::stat(path.c_str(), &named) == 0 &&
         held.st_dev == named.st_dev && held.st_ino == named.st_ino;
}

bool IsOutOfFiles(int code) { return code == EMFILE || code == ENFILE; }

bool FilesAreUsedUp() {
  // A database has a log and an index of it, and its directory is flushed.
  std::array<FileHandle, 4> files;
  for (FileHandle& file : files) {
    file = FileHandle(::open("/dev/null", O_RDONLY | O_CLOEXEC));
    if (!file.is_open()) return IsOutOfFiles(errno);
  }
  return false;
}

void ThrowOutOfFiles(const std::string& doing) {
  throw Error(ErrorCode::kUnavailable, "too_many_open_files",
              doing +
                  ": too many files are open; allow more (ulimit -n, LimitNOFILE of a service) or "
                  "fewer connections and threads");
}

void ThrowErrno(const std::string& doing, const fs::path& path, int code) {
  const std::string message =
      doing + " " + path.string() + ": " + std::generic_category().message(code);
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
      ThrowOutOfFiles(doing + " " + path.string());
    default:
      throw Error(ErrorCode::kInternal, "io_error", message);
  }
}

void RequireDiskSpace(const fs::path& directory, std::uint64_t bytes, std::uint64_t reserve_bytes) {
  std::error_code unknown;
  const std::uint64_t free = fs::space(directory, unknown).available;
  if (unknown || (free >= reserve_bytes && free - reserve_bytes >= bytes)) return;  // no overflow
  throw Error(ErrorCode::kNoSpace, "no_space",
              "only " + FormatBytes(free) + " are free on the disk of " + directory.string() +
                  ", and " + FormatBytes(reserve_bytes) +
                  " are reserved for removing images; nothing was stored. Remove images, or free "
                  "some space");
}

void SyncPath(const fs::path& path, int flags) {
  const FileHandle file(::open(path.c_str(), flags | O_CLOEXEC));
  if (!file.is_open()) ThrowErrno("cannot open", path);
  if (::fsync(file.get()) != 0) ThrowErrno("cannot flush", path);
}

void SyncDirectoryOf(const fs::path& path) {
  SyncPath(fs::absolute(path).parent_path(), O_RDONLY | O_DIRECTORY);
}

void CheckParentDirectory(const fs::path& path) {
  const fs::path parent = fs::absolute(path).parent_path();
  std::error_code ignored;
  if (!fs::is_directory(parent, ignored)) {
    throw Error(ErrorCode::kNotFound, "no_such_directory",
                "the directory " + parent.string() + " does not exist; create it first");
  }
}

}  // namespace pliant
