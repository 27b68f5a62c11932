// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/new_database.h"

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <new>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "index/files/durable_file.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 4> kSuffixes = {"", "-wal", "-shm", "-journal"};

// What cannot be removed stays as a stray file beside the database, until RemoveAbandoned.
void RemoveWithSideFiles(const fs::path& path) noexcept {
  for (const std::string_view suffix : kSuffixes) {
    try {
      std::error_code ignored;
      fs::remove(fs::path(path.string().append(suffix)), ignored);
    } catch (const std::bad_alloc&) {
      continue;
    }
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
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  const bool free = ::flock(file, LOCK_EX | LOCK_NB) == 0;
  ::close(file);
  return free;
}

}  // namespace

NewDatabaseFile::NewDatabaseFile(const fs::path& beside) {
  static std::atomic<unsigned> counter{0};
  path_ = beside;
  path_ += ".new-" + std::to_string(::getpid()) + "-" + std::to_string(++counter);
  RemoveWithSideFiles(path_);
  file_ = ::open(path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, S_IRUSR | S_IWUSR);
  if (file_ < 0) ThrowErrno("cannot make", path_);
  ::flock(file_, LOCK_EX | LOCK_NB);
}

NewDatabaseFile::~NewDatabaseFile() {
  Unlock();
  RemoveWithSideFiles(path_);
}

void NewDatabaseFile::Unlock() {
  if (file_ >= 0) ::close(file_);
  file_ = -1;
}

bool NewDatabaseFile::Publish(const fs::path& name, Over over) {
  Unlock();
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
  SyncDirectoryOf(name);
  return true;
}

void RemoveAbandoned(const fs::path& database) {
  const std::string begin = database.filename().string() + ".new-";
  std::error_code ignored;  // whoever cannot list or remove leaves things as they are
  std::vector<fs::path> abandoned;
  for (const fs::directory_entry& entry :
       fs::directory_iterator(fs::absolute(database).parent_path(), ignored)) {
    const std::string name = WithoutSuffix(entry.path().filename().string());
    const bool is_temporary =
        name.starts_with(begin) && name.size() > begin.size() &&
        name.find_first_not_of("0123456789-", begin.size()) == std::string::npos;
    if (!is_temporary) continue;
    const fs::path main = entry.path().parent_path() / name;  // it is what is locked
    if ((entry.path() == main || !fs::exists(main, ignored)) && IsAbandoned(entry.path())) {
      abandoned.push_back(main);
    }
  }
  for (const fs::path& path : abandoned) RemoveWithSideFiles(path);
}

}  // namespace pliant
