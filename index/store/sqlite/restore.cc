// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Restores a database from a backup.
#include <cerrno>
#include <optional>
#include <string>
#include <vector>

#include <SQLiteCpp/Transaction.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "descriptor/base/unix_time.h"
#include "index/files/durable_file.h"
#include "index/store/database_url.h"
#include "index/store/open_store.h"
#include "index/store/refusals.h"
#include "index/store/sqlite/database.h"
#include "index/store/sqlite/integrity.h"
#include "index/store/sqlite/new_database.h"
#include "index/store/sqlite/sqlite_connection.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr int kBusyTimeoutMs = 10'000;
constexpr const char* kAside = ".before-restore-";  // and the time

fs::path WithSuffix(const fs::path& path, const std::string& suffix) {
  fs::path with = path;
  with += suffix;
  return with;
}

[[noreturn]] void ThrowInUse(const fs::path& database) {
  throw Error(
      ErrorCode::kUnavailable, "database_in_use",
      "another process has " + database.string() + " open; stop it first: nothing was changed");
}

// Keeps every process from opening the database with SQLite, whether or not its content makes
// sense, by the locks that SQLite takes (sqlite.org/fileformat2.html, "the lock-byte page"). This
// process must not open it with SQLite meanwhile: closing it would end the locks.
class ExclusiveHold {
 public:
  explicit ExclusiveHold(const fs::path& database)
      : database_(database), file_(::open(database.c_str(), O_RDWR | O_CLOEXEC)) {
    if (!file_.is_open()) ThrowErrno("cannot open", database);
    struct flock lock = {};
    lock.l_type = F_WRLCK;
    lock.l_whence = SEEK_SET;
    lock.l_start = 0x40000000;
    lock.l_len = 512;
    if (::fcntl(file_.get(), F_SETLK, &lock) != 0) {
      if (errno != EAGAIN && errno != EACCES) ThrowErrno("cannot lock", database);
      ThrowInUse(database);
    }
    RequireInPlace();
  }

  // Throws "database_in_use" when another process has put something else in its place.
  void RequireInPlace() const {
    if (!IsSameFile(file_.get(), database_)) ThrowInUse(database_);
  }

  // The new file belongs to whom the old one belongs, who may read it as before.
  void GiveOwnerAndModeTo(const fs::path& path) const {
    struct stat old = {};
    if (::fstat(file_.get(), &old) != 0) ThrowErrno("cannot read the owner for", path);
    struct stat made = {};
    if (::stat(path.c_str(), &made) != 0) ThrowErrno("cannot read the owner of", path);
    if ((made.st_uid != old.st_uid || made.st_gid != old.st_gid) &&
        ::chown(path.c_str(), old.st_uid, old.st_gid) != 0) {
      ThrowErrno("cannot give the owner of the database to", path);
    }
    if (::chmod(path.c_str(), old.st_mode & 07777) != 0) {
      ThrowErrno("cannot give the mode of the database to", path);
    }
  }

 private:
  const fs::path database_;
  const FileHandle file_;
};

// One that is cut short is the best reason to restore a backup.
bool IsThere(const fs::path& database) {
  try {
    return InspectDatabaseFile(database) == FileState::kPliant;
  } catch (const Error& error) {
    if (error.reason() == "database_truncated") return true;
    throw;
  }
}

[[noreturn]] void ThrowDamaged(const fs::path& backup, const std::vector<std::string>& problems) {
  const std::size_t more = problems.size() - 1;
  throw Error(ErrorCode::kCorrupt, "backup_damaged",
              backup.string() + " is damaged: " + problems[0] +
                  (more > 0 ? " (and " + std::to_string(more) + " more)" : "") +
                  "; nothing was changed");
}

std::uint64_t CopyAndCheck(const fs::path& backup, const fs::path& copy) {
  {
    SqliteConnection source(backup, SqliteConnection::Mode::kReadCopy, kBusyTimeoutMs);
    CopyDatabase(source, copy);
  }
  SqliteConnection made(copy, SqliteConnection::Mode::kReadWrite, kBusyTimeoutMs);
  const std::vector<std::string> foreign = CheckSchema(made);
  if (!foreign.empty()) ThrowDamaged(backup, foreign);
  refusals::CheckSchemaVersion(backup.string(), made.Scalar("PRAGMA user_version"));
  made.database().exec("PRAGMA wal_checkpoint(TRUNCATE)");  // its log does not come along
  const std::vector<std::string> problems = CheckDatabase(made);
  if (problems.empty()) {
    return static_cast<std::uint64_t>(made.Scalar("SELECT count(*) FROM images"));
  }
  ThrowDamaged(backup, problems);
}

std::string TimeSuffix() { return kAside + FormatUtc(NowMs(), "%Y%m%dT%H%M%SZ"); }

// Gives an existing database and its log a second name. Then the log loses its first name, so that
// it is never taken for the new database's. If the power fails before the new file has its name,
// the old database has no log (EmptyLog: only a damaged one has a log), which is under the second
// name: restore again. Returns the second name; empty = there was no database.
fs::path SetAside(const fs::path& database) {
  const fs::path aside = WithSuffix(database, TimeSuffix());
  bool found = false;
  for (const char* side : {"", "-wal", "-journal"}) {
    const fs::path from = WithSuffix(database, side);
    const fs::path to = WithSuffix(aside, side);
    if (::link(from.c_str(), to.c_str()) == 0) {
      found = true;
    } else if (errno != ENOENT) {
      ThrowErrno("cannot keep what was there as", to);
    }
  }
  SyncDirectoryOf(database);
  for (const char* side : {"-wal", "-journal", "-shm"}) {
    const fs::path path = WithSuffix(database, side);
    if (::unlink(path.c_str()) != 0 && errno != ENOENT) ThrowErrno("cannot remove", path);
  }
  SyncDirectoryOf(database);
  return found ? aside : fs::path();
}

// The log gets its first name back.
void PutBack(const fs::path& aside, const fs::path& database) noexcept {
  for (const char* side : {"-wal", "-journal"}) {
    // It was not there; or it is kept under the second name, of which the user hears.
    [[maybe_unused]] const int put =
        ::link(WithSuffix(aside, side).c_str(), WithSuffix(database, side).c_str());
  }
}

// A sound database's log goes into it first: then it has none, and one step replaces it. That of a
// damaged one may be another's, and stays apart from it. In use or unreadable: left as it is.
void EmptyLog(const fs::path& database) {
  try {
    {
      SqliteConnection db(database, SqliteConnection::Mode::kReadOnly, 0);
      if (!QuickCheck(db).empty()) return;
    }
    SqliteConnection(database, SqliteConnection::Mode::kReadWrite, 0)
        .database()
        .exec("PRAGMA wal_checkpoint(TRUNCATE)");
  } catch (const SQLite::Exception&) {
    // Of a damaged database. SetAside keeps what is there.
  }
}

}  // namespace

RestoreResult RestoreDatabase(const fs::path& backup, const fs::path& name, bool replace) {
  RequireDatabaseFile(name);
  RequireDatabaseFile(backup);
  const fs::path database = fs::weakly_canonical(fs::absolute(name));  // a link stays one
  if (InspectDatabaseFile(backup) != FileState::kPliant) {
    throw Error(ErrorCode::kNotFound, "backup_not_found", "there is no backup " + backup.string());
  }
  CheckParentDirectory(database);
  RemoveAbandoned(database);
  std::error_code ignored;  // then they are not one file
  if (fs::equivalent(backup, database, ignored)) {
    throw Error(ErrorCode::kInvalidArgument, "same_file",
                backup.string() + " is the database itself; name a backup of it");
  }
  const Error exists(
      ErrorCode::kConflict, "database_exists",
      database.string() + " exists; restore over it with replace (it is kept under another name)");
  std::optional<ExclusiveHold> hold;
  if (IsThere(database)) {
    if (!replace) throw exists;
    EmptyLog(database);
    hold.emplace(database);
  }
  RestoreResult result;
  NewDatabaseFile made(database);
  const auto copy = [&] { result.images = CopyAndCheck(backup, made.path()); };
  WithDatabaseErrors(backup, copy, database);
  if (hold) hold->GiveOwnerAndModeTo(made.path());
  SyncPath(made.path(), O_RDONLY);  // what can fail, before anything is moved
  if (hold) {
    hold->RequireInPlace();
  } else if (IsThere(database)) {  // made by another process meanwhile
    throw exists;
  }
  result.before = SetAside(database);
  try {
    const auto over = hold ? NewDatabaseFile::Over::kAnything : NewDatabaseFile::Over::kEmptyFile;
    if (!made.Publish(database, over)) throw exists;
  } catch (const Error&) {
    PutBack(result.before, database);
    throw;
  }
  return result;
}

bool IsSetAside(const fs::path& name) {
  const fs::path database = fs::weakly_canonical(fs::absolute(name));
  const std::string begin = database.filename().string() + kAside;
  std::error_code ignored;  // what cannot be listed holds nothing that is known
  for (const fs::directory_entry& entry : fs::directory_iterator(database.parent_path(), ignored)) {
    if (entry.path().filename().string().starts_with(begin)) return true;
  }
  return false;
}

void CheckDatabaseFile(const fs::path& database) {
  constexpr std::uintmax_t kMostBytes = std::uintmax_t{2} << 30U;
  if (IsDatabaseUrl(database.string())) return;  // `pliant cluster check` asks its nodes
  RequireDatabaseFile(database);
  if (InspectDatabaseFile(database) != FileState::kPliant) return;
  const fs::path log = WithSuffix(database, "-wal");
  const bool is_read =
      fs::file_size(database) <= kMostBytes || (fs::exists(log) && !fs::is_empty(log));
  WithDatabaseErrors(database, [&] {
    SqliteConnection db(database, SqliteConnection::Mode::kReadOnly, kBusyTimeoutMs);
    const SQLite::Transaction reading(db.database());  // others may write meanwhile
    const std::vector<std::string> problems = is_read ? QuickCheck(db) : CheckSchema(db);
    if (problems.empty()) return;
    throw Error(
        ErrorCode::kCorrupt, "database_corrupt",
        "the database " + database.string() + " is damaged (" + problems[0] +
            "); nothing was written to it. Put a backup in its place with `pliant db restore`");
  });
}

}  // namespace pliant
