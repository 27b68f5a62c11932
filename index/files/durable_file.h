// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Files that are there after power loss, and the system's complaints as ours. Private to index/.
#pragma once

#include <filesystem>
#include <string>

namespace pliant {

// A path as text for messages.
std::string DisplayPath(const std::filesystem::path& path);

// Throws the Error for `errno`: kNoSpace "write_failed" when there is no room (on the disk, in a
// quota, under a limit of size), kReadOnly "permission_denied" or "read_only_file_system", else
// kInternal "io_error". `doing` begins the sentence: "cannot make".
[[noreturn]] void ThrowErrno(const std::string& doing, const std::filesystem::path& path);

// fsync of a file or, with O_DIRECTORY among `flags`, of a directory's entries.
void SyncPath(const std::filesystem::path& path, int flags);
void SyncDirectoryOf(const std::filesystem::path& path);

// kNotFound "no_such_directory" unless the directory that `path` lies in exists.
void CheckParentDirectory(const std::filesystem::path& path);

}  // namespace pliant
