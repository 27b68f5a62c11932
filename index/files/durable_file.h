// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Files that are there after power loss, and the system's complaints as ours. Private to index/.
#pragma once

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

// A new empty file, locked (flock) until its handle is closed: so other processes tell that its
// writer lives. Until it is locked it looks abandoned, and may be removed: then, and when the name
// is taken, `next_name` gives another name. Throws what ThrowErrno throws.
FileHandle MakeLockedFile(const std::function<std::filesystem::path()>& next_name, int mode,
                          std::filesystem::path* path);

// Whether both are one file.
bool IsSameFile(int fd, const std::filesystem::path& path);

// A path as text for messages.
std::string DisplayPath(const std::filesystem::path& path);

// Whether a call of the system failed because this process, or all together, may open no more.
bool IsOutOfFiles(int code);
// Whether it is so now, or nearly: for libraries that do not say why they cannot open a file, and
// have closed again what they had opened.
bool FilesAreUsedUp();
// Throws kUnavailable "too_many_open_files". `doing` begins the sentence: "cannot open x".
[[noreturn]] void ThrowOutOfFiles(const std::string& doing);

// Throws the Error for `errno`: kNoSpace "write_failed" when there is no room (on the disk, in a
// quota, under a limit of size), kReadOnly "permission_denied" or "read_only_file_system",
// kUnavailable "too_many_open_files", else
// kInternal "io_error". `doing` begins the sentence: "cannot make".
[[noreturn]] void ThrowErrno(const std::string& doing, const std::filesystem::path& path);

// fsync of a file or, with O_DIRECTORY among `flags`, of a directory's entries.
void SyncPath(const std::filesystem::path& path, int flags);
void SyncDirectoryOf(const std::filesystem::path& path);

// kNotFound "no_such_directory" unless the directory that `path` lies in exists.
void CheckParentDirectory(const std::filesystem::path& path);

}  // namespace pliant
