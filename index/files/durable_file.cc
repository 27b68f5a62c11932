// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/durable_file.h"

#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "index/store/sqlite/sqlite_error.h"

namespace pliant {

namespace fs = std::filesystem;

void ThrowErrno(const std::string& doing, const fs::path& path) {
  const int code = errno;
  const bool space =
      code == ENOSPC || code == EDQUOT || code == EROFS || code == EFBIG || code == EACCES;
  throw Error(space ? ErrorCode::kNoSpace : ErrorCode::kInternal,
              space ? "write_failed" : "io_error",
              doing + " " + DisplayPath(path) + ": " + std::generic_category().message(code));
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
