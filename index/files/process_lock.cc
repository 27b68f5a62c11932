// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/process_lock.h"

#include <cerrno>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "descriptor/base/hex.h"
#include "index/files/durable_file.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr const char* kInfix = ".server-";
constexpr std::size_t kRandomDigits = 16;

fs::path PathOf(const fs::path& database, const std::string& id) {
  fs::path path = database;
  path += kInfix + id;
  return path;
}

// As NewId makes them: ids come from databases, which anybody may have made, and names from
// directories, in which anything may lie.
bool IsId(const std::string& text) {
  const std::size_t dash = text.find('-');
  return dash != std::string::npos && dash > 0 && text.size() == dash + 1 + kRandomDigits &&
         text.find_first_not_of("0123456789") == dash &&
         text.find_first_not_of("0123456789abcdef", dash + 1) == std::string::npos;
}

std::string NewId() { return std::to_string(::getpid()) + "-" + RandomHex(kRandomDigits); }

// Whether the file was nobody's, who has a lock on it now.
bool LockNow(int file, int kind) { return ::flock(file, kind | LOCK_NB) == 0; }

void RemoveAbandoned(const fs::path& database) {
  const std::string begin = database.filename().string() + kInfix;
  std::vector<fs::path> found;
  std::error_code ignored;  // whoever cannot list leaves things as they are
  for (const fs::directory_entry& entry : fs::directory_iterator(database.parent_path(), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(begin) && IsId(name.substr(begin.size()))) found.push_back(entry.path());
  }
  for (const fs::path& path : found) {
    const int file = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (file < 0) continue;
    struct stat info{};
    const bool may_be_ours =
        ::fstat(file, &info) == 0 && S_ISREG(info.st_mode) && info.st_size == 0;
    if (may_be_ours && LockNow(file, LOCK_EX)) ::unlink(path.c_str());
    ::close(file);
  }
}

}  // namespace

ProcessLock::ProcessLock(const fs::path& database)
    : database_(fs::weakly_canonical(fs::absolute(database))) {
  RemoveAbandoned(database_);
  struct stat info{};
  do {  // until it is locked it looks as if its process were dead, and may be removed
    if (file_ >= 0) ::close(file_);
    id_ = NewId();
    path_ = PathOf(database_, id_);
    file_ = ::open(path_.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, S_IRUSR | S_IWUSR);
    if (file_ < 0) ThrowErrno("cannot make", path_);
    if (::flock(file_, LOCK_EX) != 0 || ::fstat(file_, &info) != 0) {
      const int code = errno;
      ::unlink(path_.c_str());
      ::close(file_);
      errno = code;
      ThrowErrno("cannot lock", path_);
    }
  } while (info.st_nlink == 0);
}

ProcessLock::~ProcessLock() {
  ::unlink(path_.c_str());
  ::close(file_);
}

bool ProcessLock::IsInPlace() const {
  struct stat mine{};
  struct stat named{};
  return ::fstat(file_, &mine) == 0 && ::stat(path_.c_str(), &named) == 0 &&
         mine.st_dev == named.st_dev && mine.st_ino == named.st_ino;
}

bool ProcessLock::IsHeld(const std::string& id) const {
  if (!IsId(id)) return false;  // the owner of no job that we wrote
  const fs::path path = PathOf(database_, id);
  const int file = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (file < 0) return errno != ENOENT || !IsInPlace();
  const bool free = LockNow(file, LOCK_SH);
  ::close(file);
  return !free;
}

}  // namespace pliant
