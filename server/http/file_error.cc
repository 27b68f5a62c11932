// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/file_error.h"

#include <cerrno>
#include <cstring>
#include <string>

#include <sys/statvfs.h>

#include "descriptor/base/error.h"

namespace pliant::server {

void ThrowFileError(const std::filesystem::path& path, int number) {
  const std::string what = path.string() + ": " + std::strerror(number);
  switch (number) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      throw Error(ErrorCode::kNoSpace, "no_space", what);
    case EACCES:
    case EPERM:
    case EROFS:
      throw Error(ErrorCode::kReadOnly, "read_only", what);
    case EMFILE:
    case ENFILE:
      throw Error(ErrorCode::kUnavailable, "too_many_open_files", what);
    default:
      throw Error(ErrorCode::kInternal, "io_error", what);
  }
}

void RequireDiskSpace(const std::filesystem::path& directory, std::uint64_t bytes,
                      std::uint64_t reserve) {
  struct statvfs disk{};
  if (::statvfs(directory.c_str(), &disk) != 0) ThrowFileError(directory, errno);
  const std::uint64_t available = std::uint64_t{disk.f_bavail} * disk.f_frsize;
  if (available >= reserve && available - reserve >= bytes) return;  // a sum could overflow
  ThrowFileError(directory, ENOSPC);
}

}  // namespace pliant::server
