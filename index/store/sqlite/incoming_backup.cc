// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/incoming_backup.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "index/files/durable_file.h"
#include "index/store/open_store.h"
#include "index/store/refusals.h"
#include "index/store/sqlite/database.h"
#include "index/store/sqlite/integrity.h"
#include "index/store/sqlite/new_database.h"
#include "index/store/sqlite/schema.h"
#include "index/store/sqlite/schema_check.h"
#include "index/store/sqlite/sqlite_connection.h"
#include "index/store/sqlite/sqlite_error.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic("SQLite format 3", 16);  // with its zero
constexpr std::uint64_t kLookEvery = 4 * 1024 * 1024;      // at the free space

using Clock = std::chrono::steady_clock;
constexpr std::chrono::minutes kCheckTime{1};  // on a slow disk
constexpr std::chrono::minutes kCheckTimePerGib{1};

[[noreturn]] void ThrowStopped() {
  throw Error(ErrorCode::kCancelled, "check_stopped", "stopped on request");
}

[[noreturn]] void ThrowForeign(const fs::path& target) {
  throw Error(ErrorCode::kCorrupt, "not_a_database",
              "what was sent for " + DisplayPath(target) + " is no Pliant database");
}

Error Exists(const fs::path& target) {
  return {ErrorCode::kConflict, "backup_exists", DisplayPath(target) + " exists already"};
}

void RequireSpace(const fs::path& directory, std::uint64_t bytes, std::uint64_t reserve) {
  struct statvfs disk{};
  if (::statvfs(directory.c_str(), &disk) != 0) ThrowErrno("cannot look at the disk of", directory);
  const std::uint64_t available = std::uint64_t{disk.f_bavail} * disk.f_frsize;
  if (available >= reserve && available - reserve >= bytes) return;  // a sum could overflow
  errno = ENOSPC;
  ThrowErrno("cannot keep a backup in", directory);
}

class IncomingFile final : public IncomingBackup {
 public:
  IncomingFile(fs::path target, std::uint64_t reserve_bytes, std::function<bool()> stop)
      : target_(std::move(target)),
        reserve_bytes_(reserve_bytes),
        stop_(std::move(stop)),
        made_(target_) {
    file_ = ::open(made_.path().c_str(), O_WRONLY | O_CLOEXEC);
    if (file_ < 0) ThrowErrno("cannot write", made_.path());
  }
  ~IncomingFile() override { Close(); }

  void Append(std::string_view bytes) override {
    CheckBegin(bytes);
    if (written_ == 0 || written_ - looked_ >= kLookEvery) {
      RequireSpace(target_.parent_path(), kLookEvery + bytes.size(), reserve_bytes_);
      looked_ = written_;
    }
    while (!bytes.empty()) {
      const ssize_t n = ::write(file_, bytes.data(), bytes.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) ThrowErrno("cannot write", made_.path());
      bytes.remove_prefix(static_cast<std::size_t>(n));
      written_ += static_cast<std::uint64_t>(n);
    }
  }

  void Publish() override {
    Close();
    if (InspectDatabaseFile(made_.path()) != FileState::kPliant) ThrowForeign(target_);
    WithDatabaseErrors(made_.path(), [&] { Check(); });
    if (!made_.Publish(target_, NewDatabaseFile::Over::kNothing)) throw Exists(target_);
  }

 private:
  void Close() {
    if (file_ >= 0) ::close(file_);
    file_ = -1;
  }

  // So that nothing else is written, for which a sweep would not know that it is ours.
  void CheckBegin(std::string_view bytes) {
    if (written_ >= kMagic.size()) return;
    const std::string_view rest = kMagic.substr(written_);
    const std::size_t common = std::min(rest.size(), bytes.size());
    if (rest.substr(0, common) != bytes.substr(0, common)) ThrowForeign(target_);
  }

  void Check() const {
    if (stop_()) ThrowStopped();
    const auto until = Clock::now() + kCheckTime + (written_ >> 30) * kCheckTimePerGib;
    try {
      SqliteConnection db(made_.path(), SqliteConnection::Mode::kReadCopy, 0);
      db.StopWhen([&] { return stop_() || Clock::now() > until; });
      Check(db);
    } catch (const SQLite::Exception& error) {
      if (error.getErrorCode() != SQLITE_INTERRUPT) throw;
      if (stop_()) ThrowStopped();
      ThrowBad("check_too_long", "takes too long to be checked");
    }
  }

  void Check(SqliteConnection& db) const {
    db.database().exec("PRAGMA cell_size_check = ON");
    const std::int64_t version = db.Scalar("PRAGMA user_version");
    if (version < 1) ThrowForeign(target_);
    if (version != kSchemaVersion) ThrowBad("other_schema", "was made by another Pliant");
    // Before any query: what it would run on may be a view that never ends.
    const std::vector<std::string> foreign = CheckSchema(db, Others::kRefused);
    if (!foreign.empty()) ThrowBad("foreign_schema", "was changed: " + foreign[0]);
    const std::vector<std::string> problems = QuickCheck(db);
    if (!problems.empty()) ThrowBad("database_corrupt", "is damaged: " + problems[0]);
  }

  [[noreturn]] void ThrowBad(const char* reason, const std::string& why) const {
    throw Error(ErrorCode::kCorrupt, reason,
                "what was sent for " + DisplayPath(target_) + " " + why);
  }

  const fs::path target_;
  const std::uint64_t reserve_bytes_;
  const std::function<bool()> stop_;
  NewDatabaseFile made_;
  int file_ = -1;
  std::uint64_t written_ = 0;
  std::uint64_t looked_ = 0;  // written_ when the disk was looked at
};

}  // namespace

std::unique_ptr<IncomingBackup> ReceiveBackup(const fs::path& name, std::uint64_t bytes,
                                              std::uint64_t reserve_bytes,
                                              std::function<bool()> stop) {
  const fs::path target = fs::absolute(name);
  CheckParentDirectory(target);
  std::error_code ignored;
  if (fs::exists(fs::symlink_status(target, ignored))) throw Exists(target);
  RemoveAbandonedBackups(target.parent_path());
  RequireSpace(target.parent_path(), bytes, reserve_bytes);
  return std::make_unique<IncomingFile>(target, reserve_bytes, std::move(stop));
}

}  // namespace pliant
