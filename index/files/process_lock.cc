// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/process_lock.h"

#include <cerrno>
#include <random>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "index/files/durable_file.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr const char* kInfix = ".server-";

fs::path PathOf(const fs::path& database, const std::string& id) {
  fs::path path = fs::absolute(database);
  path += kInfix + id;
  return path;
}

// Ids come from databases, which anybody may have made.
bool IsId(const std::string& text) {
  return !text.empty() && text.size() <= 64 &&
         text.find_first_not_of("0123456789abcdef-") == std::string::npos;
}

std::string NewId() {
  constexpr const char* kDigits = "0123456789abcdef";
  std::random_device random;
  std::string id = std::to_string(::getpid()) + "-";
  for (int i = 0; i < 16; ++i) id += kDigits[random() % 16];
  return id;
}

// Whether the file was nobody's, who has a lock on it now.
bool LockNow(int file, int kind) { return ::flock(file, kind | LOCK_NB) == 0; }

void RemoveAbandoned(const fs::path& database) {
  const std::string begin = database.filename().string() + kInfix;
  std::vector<fs::path> found;
  std::error_code ignored;  // whoever cannot list leaves things as they are
  for (const fs::directory_entry& entry :
       fs::directory_iterator(fs::absolute(database).parent_path(), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(begin) && IsId(name.substr(begin.size()))) found.push_back(entry.path());
  }
  for (const fs::path& path : found) {
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (file < 0) continue;
    if (LockNow(file, LOCK_EX)) ::unlink(path.c_str());
    ::close(file);
  }
}

}  // namespace

ProcessLock::ProcessLock(const fs::path& database) {
  RemoveAbandoned(database);
  struct stat info {};
  do {  // until it is locked it looks as if its process were dead, and may be removed
    if (file_ >= 0) ::close(file_);
    id_ = NewId();
    path_ = PathOf(database, id_);
    file_ = ::open(path_.c_str(), O_CREAT | O_EXCL | O_RDONLY | O_CLOEXEC, S_IRUSR | S_IWUSR);
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

bool ProcessLock::IsHeld(const fs::path& database, const std::string& id) {
  if (!IsId(id)) return false;  // the owner of no job that we wrote
  const fs::path path = PathOf(database, id);
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (file < 0) return errno != ENOENT;
  const bool free = LockNow(file, LOCK_SH);
  ::close(file);
  return !free;
}

}  // namespace pliant
