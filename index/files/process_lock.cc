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

FileHandle Open(const fs::path& path) {
  return FileHandle(::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
}

void RemoveAbandoned(const fs::path& database) {
  const std::string begin = database.filename().string() + kInfix;
  std::vector<fs::path> found;
  std::error_code ignored;  // without permission to list, nothing changes
  for (const fs::directory_entry& entry : fs::directory_iterator(database.parent_path(), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(begin) && IsId(name.substr(begin.size()))) found.push_back(entry.path());
  }
  for (const fs::path& path : found) {
    const FileHandle file = Open(path);
    if (!file.is_open()) continue;
    struct stat info = {};
    const bool may_be_ours =
        ::fstat(file.get(), &info) == 0 && S_ISREG(info.st_mode) && info.st_size == 0;
    if (may_be_ours && ::flock(file.get(), LOCK_EX | LOCK_NB) == 0) ::unlink(path.c_str());
  }
}

}  // namespace

ProcessLock::ProcessLock(const fs::path& database)
    : database_(fs::weakly_canonical(fs::absolute(database))) {
  RemoveAbandoned(database_);
  const auto next_name = [this] { return PathOf(database_, id_ = NewId()); };
  file_ = MakeLockedFile(next_name, S_IRUSR | S_IWUSR, &path_);
}

ProcessLock::~ProcessLock() { ::unlink(path_.c_str()); }

bool ProcessLock::IsHeld(const std::string& id) const {
  if (!IsId(id)) return false;  // the owner of no job that we wrote
  const FileHandle file = Open(PathOf(database_, id));
  if (!file.is_open()) return errno != ENOENT || !IsSameFile(file_.get(), path_);
  return ::flock(file.get(), LOCK_SH | LOCK_NB) != 0;
}

}  // namespace pliant
