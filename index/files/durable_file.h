// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Files that survive power loss, and the system's errors as Error.
#pragma once

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>

namespace pliant {

// An open file; closed at the end of its scope, with errno as it was.
class FileHandle {
 public:
  explicit FileHandle(int fd = -1) : fd_(fd) {}
  ~FileHandle() { Close(); }
  FileHandle(FileHandle&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileHandle& operator=(FileHandle&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }

  int get() const { return fd_; }
  bool is_open() const { return fd_ >= 0; }
  void Close() noexcept;

 private:
  int fd_;
};

// A new empty file, locked (flock) until its handle is closed. The lock tells other processes that
// its writer lives. Before it is locked, another process can take it for abandoned and remove it.
// In that case, and if the name is taken, `next_name` gives another name. Throws what ThrowErrno
// throws.
FileHandle MakeLockedFile(const std::function<std::filesystem::path()>& next_name, int mode,
                          std::filesystem::path* path);

// Whether both are the same file.
bool IsSameFile(int fd, const std::filesystem::path& path);

// Whether a system call failed because this process, or the whole system, has too many open files.
bool IsOutOfFiles(int code);
// Whether the limit of open files is reached, or nearly. For libraries that do not report why they
// cannot open a file, and have closed other files again.
bool FilesAreUsedUp();
// Throws kUnavailable "too_many_open_files". `doing` begins the sentence: "cannot open x".
[[noreturn]] void ThrowOutOfFiles(const std::string& doing);

// Throws the Error for `code`: kNoSpace "write_failed" if there is no space (disk, quota or file
// size limit), kReadOnly "permission_denied" or "read_only_file_system", kUnavailable
// "too_many_open_files", else kInternal "io_error". `doing` begins the sentence: "cannot make".
[[noreturn]] void ThrowErrno(const std::string& doing, const std::filesystem::path& path,
                             int code = errno);

// Throws kNoSpace "no_space" unless `bytes` fit on the disk of the directory and leave
// `reserve_bytes` free. Where the system does not say, the write itself will tell.
void RequireDiskSpace(const std::filesystem::path& directory, std::uint64_t bytes,
                      std::uint64_t reserve_bytes);

// fsync of a file or, with O_DIRECTORY among `flags`, of a directory's entries.
void SyncPath(const std::filesystem::path& path, int flags);
void SyncDirectoryOf(const std::filesystem::path& path);

// kNotFound "no_such_directory" unless the directory that `path` lies in exists.
void CheckParentDirectory(const std::filesystem::path& path);

}  // namespace pliant
