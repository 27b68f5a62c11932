// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/new_database.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "descriptor/base/hex.h"
#include "index/store/open_store.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMark = ".new-";
// The file itself last: as long as it is there, what remains is found.
constexpr std::array<std::string_view, 4> kSuffixes = {"-wal", "-shm", "-journal", ""};

// What cannot be removed stays as a stray file beside the database, until RemoveAbandoned.
void RemoveWithSideFiles(const fs::path& path) noexcept {
  for (const std::string_view suffix : kSuffixes) {
    std::error_code ignored;
    fs::remove(fs::path(path.string().append(suffix)), ignored);
  }
}

// The name of the file that `name` stands beside, or `name` itself.
std::string WithoutSuffix(const std::string& name) {
  for (const std::string_view suffix : kSuffixes) {
    if (!suffix.empty() && name.ends_with(suffix)) {
      return name.substr(0, name.size() - suffix.size());
    }
  }
  return name;
}

bool IsAbandoned(const fs::path& path) {
  constexpr std::chrono::minutes kUnlockedFor{1};  // a living process takes no time to name it
  std::error_code error;
  const auto written = fs::last_write_time(path, error);
  if (error || fs::file_time_type::clock::now() - written < kUnlockedFor) return false;
  const FileHandle file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  return file.is_open() && ::flock(file.get(), LOCK_EX | LOCK_NB) == 0;
}

// Whether `name` is that of a NewDatabaseFile, with kMark at `mark`: a process number, a dash, and
// hex digits.
bool IsTemporaryName(const std::string& name, std::size_t mark) {
  if (mark == std::string::npos) return false;
  const std::size_t process = mark + std::strlen(kMark);
  const std::size_t dash = name.find_first_not_of("0123456789", process);
  return dash != std::string::npos && dash > process && name[dash] == '-' &&
         dash + 1 < name.size() &&
         name.find_first_not_of("0123456789abcdef", dash + 1) == std::string::npos;
}

// A database, or one of which no page has been written yet, or only side files.
bool MayBeDatabase(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return !fs::exists(path);
  std::array<char, 16> begin{};
  file.read(begin.data(), begin.size());
  if (file.gcount() == 0) return file.eof();
  return begin == std::array<char, 16>{} ||
         std::memcmp(begin.data(), "SQLite format 3", begin.size()) == 0;
}

// Removes the databases in `directory` that nobody makes any more and that `is_ours` names, also
// side files that have outlived theirs; how many.
std::uint64_t RemoveDatabases(const fs::path& directory,
                              const std::function<bool(const fs::path&)>& is_ours) {
  std::error_code ignored;  // without permission, nothing changes
  std::set<fs::path> abandoned;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, ignored)) {
    const fs::path main = directory / WithoutSuffix(entry.path().filename().string());
    const bool outlived = entry.path() != main && !fs::exists(main, ignored);  // main is locked
    if ((entry.path() == main || outlived) && is_ours(main) && IsAbandoned(entry.path())) {
      abandoned.insert(main);
    }
  }
  for (const fs::path& path : abandoned) RemoveWithSideFiles(path);
  return abandoned.size();
}

}  // namespace

NewDatabaseFile::NewDatabaseFile(const fs::path& beside) {
  // Random: two containers can have processes of one number.
  path_ = beside;
  path_ += kMark + std::to_string(::getpid()) + "-" + RandomHex(16);
  file_ =
      FileHandle(::open(path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, S_IRUSR | S_IWUSR));
  if (!file_.is_open()) ThrowErrno("cannot make", path_);
  ::flock(file_.get(), LOCK_EX | LOCK_NB);  // where the file system can
}

NewDatabaseFile::~NewDatabaseFile() {
  file_.Close();
  RemoveWithSideFiles(path_);
}

bool NewDatabaseFile::Publish(const fs::path& name, Over over) {
  file_.Close();
  SyncPath(path_, O_RDONLY);
  std::error_code ignored;  // an absent file has no size
  const bool replaces =
      over == Over::kAnything ||
      (over == Over::kEmptyFile && fs::exists(name, ignored) && fs::file_size(name, ignored) == 0);
  if (replaces) {
    if (::rename(path_.c_str(), name.c_str()) != 0) ThrowErrno("cannot make", name);
  } else if (::renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, name.c_str(), RENAME_NOREPLACE) != 0 &&
             (errno != EINVAL || ::link(path_.c_str(), name.c_str()) != 0)) {
    if (errno == EEXIST) return false;
    ThrowErrno("cannot make", name);
  }
  try {
    SyncDirectoryOf(name);
  } catch (...) {
    // Power loss can still remove it: a later try must not find it and take it for complete.
    if (over == Over::kNothing) ::unlink(name.c_str());
    throw;
  }
  return true;
}

void RemoveAbandoned(const fs::path& database) {
  const std::string own = database.filename().string();
  RemoveDatabases(fs::absolute(database).parent_path(), [&](const fs::path& path) {
    const std::string name = path.filename().string();
    return name.starts_with(own + kMark) && IsTemporaryName(name, own.size());
  });
}

std::uint64_t RemoveAbandonedBackups(const fs::path& directory) {
  return RemoveDatabases(fs::absolute(directory), [](const fs::path& path) {
    const std::string name = path.filename().string();
    return IsTemporaryName(name, name.rfind(kMark)) && MayBeDatabase(path);
  });
}

}  // namespace pliant
