// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/body_file.h"

#include <algorithm>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "descriptor/base/replace_file.h"

namespace pliant::server {

namespace {

constexpr std::uint64_t kCheckEvery = 4 * 1024 * 1024;  // bytes between two checks of the disk

FileHandle Open(const std::filesystem::path& directory) {
  FileHandle nameless(::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));
  if (nameless.is_open()) return nameless;
  if (errno != EOPNOTSUPP && errno != EISDIR && errno != ENOENT) {
    ThrowErrno("cannot make a file in", directory);
  }
  std::string name = (directory / ".pliant-answer-XXXXXX").string();  // network file systems
  FileHandle file(::mkostemp(name.data(), O_CLOEXEC));
  if (!file.is_open()) ThrowErrno("cannot make", name);
  ::unlink(name.c_str());
  return file;
}

}  // namespace

BodyFile::BodyFile(const std::filesystem::path& directory, std::uint64_t reserve_bytes)
    : BodyFile(Open(directory), directory, reserve_bytes) {}

BodyFile::BodyFile(FileHandle file, std::filesystem::path directory, std::uint64_t reserve_bytes)
    : directory_(std::move(directory)), reserve_bytes_(reserve_bytes), file_(std::move(file)) {}

BodyFile::BodyFile(const std::filesystem::path& file)
    : directory_(file.parent_path()),
      file_(::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC)) {
  const Error absent(ErrorCode::kNotFound, "file_not_found", "there is no file " + file.string());
  if (!file_.is_open()) {
    if (errno == ENOENT || errno == ELOOP || errno == ENXIO) throw absent;
    ThrowErrno("cannot open", file);
  }
  struct stat info = {};
  if (::fstat(file_.get(), &info) != 0 || !S_ISREG(info.st_mode)) throw absent;
  size_ = static_cast<std::uint64_t>(info.st_size);
  version_ = fmt::format("{:x}-{:x}-{:x}.{:x}", info.st_ino, info.st_size, info.st_mtim.tv_sec,
                         info.st_mtim.tv_nsec);
}

BodyFile::BodyFile(std::shared_ptr<const BodyFile> whole, std::uint64_t first, std::uint64_t bytes)
    : whole_(std::move(whole)), first_(first), size_(bytes) {}

void BodyFile::Write(std::uint64_t offset, std::string_view bytes) {
  if (written_ == 0 || written_ - checked_ >= kCheckEvery) {
    Reserve(kCheckEvery + bytes.size());
    checked_ = written_;
  }
  if (const std::error_code error = WriteAt(file_.get(), offset, bytes)) {
    ThrowErrno("cannot write to", directory_, error.value());
  }
  written_ += bytes.size();
  size_ = std::max(size_, offset + bytes.size());
}

std::ptrdiff_t BodyFile::Read(std::uint64_t offset, char* data, std::size_t bytes) const {
  if (offset >= size_) return 0;
  bytes = static_cast<std::size_t>(std::min<std::uint64_t>(bytes, size_ - offset));
  if (whole_) return whole_->Read(first_ + offset, data, bytes);
  while (true) {
    const ssize_t got = ::pread(file_.get(), data, bytes, static_cast<off_t>(offset));
    if (got >= 0 || errno != EINTR) return got;
  }
}

}  // namespace pliant::server
