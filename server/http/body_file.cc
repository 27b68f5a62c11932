// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/body_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "descriptor/base/error.h"

namespace pliant::server {

namespace {

constexpr std::uint64_t kCheckEvery = 4 * 1024 * 1024;  // bytes between two checks of the disk

int Open(const std::filesystem::path& directory) {
  const int nameless = ::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (nameless >= 0) return nameless;
  if (errno != EOPNOTSUPP && errno != EISDIR && errno != ENOENT) ThrowFileError(directory, errno);
  std::string name = (directory / ".pliant-answer-XXXXXX").string();  // network file systems
  const int fd = ::mkostemp(name.data(), O_CLOEXEC);
  if (fd < 0) ThrowFileError(directory, errno);
  ::unlink(name.c_str());
  return fd;
}

}  // namespace

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
  std::error_code error;
  const std::uint64_t available = std::filesystem::space(directory, error).available;
  if (error) ThrowFileError(directory, error.value());
  if (available >= reserve && available - reserve >= bytes) return;  // a sum could overflow
  ThrowFileError(directory, ENOSPC);
}

BodyFile::BodyFile(std::filesystem::path directory, std::uint64_t reserve_bytes)
    : directory_(std::move(directory)), reserve_bytes_(reserve_bytes), fd_(Open(directory_)) {}

BodyFile::BodyFile(const std::filesystem::path& file)
    : directory_(file.parent_path()),
      fd_(::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC)) {
  const Error absent(ErrorCode::kNotFound, "file_not_found", "there is no file " + file.string());
  if (fd_ < 0 && (errno == ENOENT || errno == ELOOP || errno == ENXIO)) throw absent;
  if (fd_ < 0) ThrowFileError(file, errno);
  struct stat info{};
  if (::fstat(fd_, &info) != 0 || !S_ISREG(info.st_mode)) {
    ::close(fd_);
    throw absent;
  }
  size_ = static_cast<std::uint64_t>(info.st_size);
  version_ = fmt::format("{:x}-{:x}-{:x}.{:x}", info.st_ino, info.st_size, info.st_mtim.tv_sec,
                         info.st_mtim.tv_nsec);
}

BodyFile::BodyFile(std::shared_ptr<const BodyFile> whole, std::uint64_t first, std::uint64_t bytes)
    : whole_(std::move(whole)), first_(first), size_(bytes) {}

BodyFile::~BodyFile() {
  if (fd_ >= 0) ::close(fd_);
}

void BodyFile::Write(std::uint64_t offset, std::string_view bytes) {
  if (written_ == 0 || written_ - checked_ >= kCheckEvery) {
    Reserve(kCheckEvery + bytes.size());
    checked_ = written_;
  }
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) ThrowFileError(directory_, errno);
    bytes.remove_prefix(static_cast<std::size_t>(written));
    offset += static_cast<std::uint64_t>(written);
    written_ += static_cast<std::uint64_t>(written);
    size_ = std::max(size_, offset);
  }
}

std::ptrdiff_t BodyFile::Read(std::uint64_t offset, char* data, std::size_t bytes) const {
  if (offset >= size_) return 0;
  bytes = static_cast<std::size_t>(std::min<std::uint64_t>(bytes, size_ - offset));
  if (whole_) return whole_->Read(first_ + offset, data, bytes);
  while (true) {
    const ssize_t got = ::pread(fd_, data, bytes, static_cast<off_t>(offset));
    if (got >= 0 || errno != EINTR) return got;
  }
}

}  // namespace pliant::server
