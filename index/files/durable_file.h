// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Files that are there after power loss, and the system's complaints as ours. Private to index/.
#pragma once

#include <filesystem>
#include <string>

namespace pliant {

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
