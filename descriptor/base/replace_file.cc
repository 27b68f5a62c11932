// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/base/replace_file.h"

#include <cerrno>
#include <cstdio>
#include <string>

#include <fcntl.h>
#include <unistd.h>

namespace pliant {
namespace {

std::error_code LastError() { return {errno, std::generic_category()}; }

std::error_code Flush(int fd) { return ::fsync(fd) == 0 ? std::error_code() : LastError(); }

std::error_code WriteNew(const std::string& path, std::span<const std::string_view> parts) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (fd < 0) return LastError();
  std::error_code error;
  std::uint64_t offset = 0;
  for (const std::string_view part : parts) {
    if (!error) error = WriteAt(fd, offset, part);
    offset += part.size();
  }
  if (::close(fd) != 0 && !error) error = LastError();
  return error;
}

// A rename is an entry of the directory, which has to reach the disk as well. File systems that
// cannot flush directories say EINVAL (PostgreSQL ignores it, too): the content is flushed.
std::error_code FlushDirectory(const std::filesystem::path& directory) {
  const int fd = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return errno == EACCES ? std::error_code() : LastError();  // written, not listed
  const std::error_code error = Flush(fd);
  ::close(fd);
  return error == std::errc::invalid_argument ? std::error_code() : error;
}

}  // namespace

std::error_code WriteAt(int fd, std::uint64_t offset, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(fd, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return LastError();
    bytes.remove_prefix(static_cast<std::size_t>(written));
    offset += static_cast<std::uint64_t>(written);
  }
  return {};
}

std::error_code ReplaceFile(const std::filesystem::path& path,
                            std::span<const std::string_view> parts) {
  const std::string temporary = TemporaryNameOf(path);
  std::error_code error = WriteNew(temporary, parts);
  if (!error) error = PublishFile(temporary, path);
  if (error) ::unlink(temporary.c_str());
  return error;
}

std::string TemporaryNameOf(const std::filesystem::path& path) {
  return path.string() + ".part-" + std::to_string(::getpid());
}

std::error_code PublishFile(const std::string& temporary, const std::filesystem::path& path) {
  const int fd = ::open(temporary.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return LastError();
  const std::error_code error = Flush(fd);
  ::close(fd);
  if (error) return error;
  if (std::rename(temporary.c_str(), path.c_str()) != 0) return LastError();
  return FlushDirectory(path.has_parent_path() ? path.parent_path() : ".");
}

}  // namespace pliant
