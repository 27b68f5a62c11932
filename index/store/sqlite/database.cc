// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/database.h"

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include <SQLiteCpp/Backup.h>
#include <SQLiteCpp/VariadicBind.h>
#include <fcntl.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "index/files/durable_file.h"
#include "index/records/records.h"
#include "index/store/sqlite/schema.h"
#include "index/store/sqlite/sqlite_error.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kHeaderBytes = 100;  // of an SQLite file
using Header = std::array<unsigned char, kHeaderBytes>;

std::uint32_t BigEndian(const Header& header, std::size_t at, int bytes) {
  std::uint32_t value = 0;
  for (int i = 0; i < bytes; ++i) value = value << 8 | header[at + i];
  return value;
}

[[noreturn]] void ThrowForeign(const fs::path& path, const std::string& why) {
  throw Error(ErrorCode::kCorrupt, "not_a_database",
              DisplayPath(path) + " is not a Pliant database (" + why +
                  "); it was left untouched: name another file");
}

// The file itself last: as long as it is there, what remains is found.
constexpr const char* kSideFiles[] = {"-wal", "-shm", "-journal", ""};
constexpr const char* kTemporaryMark = ".new-";

void RemoveWithSideFiles(const fs::path& path) noexcept {
  for (const char* suffix : kSideFiles) {
    std::error_code ignored;  // it is not there, or it stays as a stray file beside the database
    fs::remove(fs::path(path.string() + suffix), ignored);
  }
}

// A database in the making: an empty file that only its owner may read, because a database holds
// people's pictures (whoever wants others to read it changes the mode afterwards, and SQLite's side
// files follow). It is locked, by flock(), which SQLite does not use: one that nobody locks is of a
// process that was killed. Removed with its side files unless it has got another name.
class TemporaryFile {
 public:
  explicit TemporaryFile(const fs::path& beside) {
    static std::atomic<unsigned> counter{0};
    path_ = beside;
    path_ += kTemporaryMark + std::to_string(::getpid()) + "-" + std::to_string(++counter);
    RemoveWithSideFiles(path_);
    file_ = ::open(path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, S_IRUSR | S_IWUSR);
    if (file_ < 0) ThrowErrno("cannot make", path_);
    ::flock(file_, LOCK_EX | LOCK_NB);
  }
  ~TemporaryFile() {
    Unlock();
    RemoveWithSideFiles(path_);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const fs::path& path() const { return path_; }

  // Before it gets its name: closing a file ends all locks of the process that SQLite holds on it.
  void Unlock() {
    if (file_ >= 0) ::close(file_);
    file_ = -1;
  }

 private:
  fs::path path_;
  int file_ = -1;
};

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

// Whether `name` is that of a TemporaryFile, with kTemporaryMark at `mark`.
bool IsTemporaryName(const std::string& name, std::size_t mark) {
  const std::size_t digits = mark + std::strlen(kTemporaryMark);
  return mark != std::string::npos && name.size() > digits &&
         name.find_first_not_of("0123456789-", digits) == std::string::npos;
}

// A database, or one of which no page has been written yet.
bool MayBeDatabase(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 16> begin{};
  file.read(begin.data(), begin.size());
  if (file.gcount() == 0) return file.eof();
  return begin == std::array<char, 16>{} ||
         std::memcmp(begin.data(), "SQLite format 3", begin.size()) == 0;
}

// Removes the databases in `directory` that `is_abandoned` names.
std::uint64_t RemoveDatabases(const fs::path& directory,
                              const std::function<bool(const fs::path&)>& is_abandoned) {
  std::error_code ignored;  // whoever cannot list or remove leaves things as they are
  std::vector<fs::path> abandoned;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, ignored)) {
    if (is_abandoned(entry.path())) abandoned.push_back(entry.path());
  }
  for (const fs::path& path : abandoned) RemoveWithSideFiles(path);
  return abandoned.size();
}

// Gives `from` the name `to` unless that name is taken by more than an empty file. False = taken.
bool Publish(const fs::path& from, const fs::path& to, bool may_replace_empty) {
  SyncPath(from, O_RDONLY);
  std::error_code ignored;  // an absent file has no size
  if (may_replace_empty && fs::exists(to, ignored) && fs::file_size(to, ignored) == 0) {
    if (::rename(from.c_str(), to.c_str()) != 0) ThrowErrno("cannot make", to);
  } else if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) != 0 &&
             (errno != EINVAL || ::link(from.c_str(), to.c_str()) != 0)) {
    if (errno == EEXIST) return false;
    ThrowErrno("cannot make", to);
  }
  SyncDirectoryOf(to);
  return true;
}

}  // namespace

std::int64_t NowMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

void RemoveAbandoned(const fs::path& database) {
  const std::string begin = database.filename().string() + kTemporaryMark;
  RemoveDatabases(fs::absolute(database).parent_path(), [&](const fs::path& path) {
    const std::string name = path.filename().string();
    const std::size_t mark = begin.size() - std::strlen(kTemporaryMark);
    return name.starts_with(begin) && IsTemporaryName(name, mark) && IsAbandoned(path);
  });
}

std::uint64_t RemoveAbandonedBackups(const fs::path& directory) {
  return RemoveDatabases(fs::absolute(directory), [](const fs::path& path) {
    const std::string name = path.filename().string();
    return IsTemporaryName(name, name.rfind(kTemporaryMark)) && IsAbandoned(path) &&
           MayBeDatabase(path);
  });
}

FileState InspectDatabaseFile(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found) return FileState::kAbsent;
  if (!fs::is_regular_file(status)) ThrowForeign(path, "it is no regular file");
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    throw Error(ErrorCode::kNotFound, "cannot_open",
                "the database " + DisplayPath(path) + " cannot be read; check its permissions");
  }
  Header header{};
  file.read(reinterpret_cast<char*>(header.data()), header.size());
  const auto got = static_cast<std::size_t>(file.gcount());
  if (got == 0) return FileState::kEmpty;
  if (got < header.size() || std::memcmp(header.data(), "SQLite format 3", 16) != 0) {
    ThrowForeign(path, "its content is of another type");
  }
  if (BigEndian(header, 68, 4) != kApplicationId)
    ThrowForeign(path, "another program's SQLite file");
  const std::uint32_t page = BigEndian(header, 16, 2) == 1 ? 65536 : BigEndian(header, 16, 2);
  const std::uint64_t expected = std::uint64_t{page} * BigEndian(header, 28, 4);
  const fs::path wal = path.string() + "-wal";
  if (fs::file_size(path) < expected && (!fs::exists(wal) || fs::file_size(wal) == 0)) {
    throw Error(ErrorCode::kCorrupt, "database_truncated",
                DisplayPath(path) + " is cut short (" + std::to_string(fs::file_size(path)) +
                    " of " + std::to_string(expected) + " bytes); restore a backup");
  }
  return FileState::kPliant;
}

void CreateDatabase(const fs::path& path, const DescriptorInfo& model) {
  CheckParentDirectory(path);
  TemporaryFile temporary(path);
  {
    SQLite::Database database(fs::absolute(temporary.path()).string(),
                              SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    database.exec("PRAGMA page_size = 8192");
    database.exec("PRAGMA auto_vacuum = INCREMENTAL");
    database.exec("PRAGMA application_id = " + std::to_string(kApplicationId));
    database.exec("PRAGMA journal_mode = WAL");
    Migrate(database, Migrations());
    SQLite::Transaction transaction(database);
    SQLite::Statement add_model(
        database, "INSERT INTO models (name, model_id, kind, dim) VALUES (?, ?, ?, ?)");
    SQLite::bind(add_model, model.name, model.model_id, static_cast<int>(model.kind), model.dim);
    add_model.exec();
    SQLite::Statement add_collection(
        database, "INSERT INTO collections (name, model, created_ms) VALUES (?, ?, ?)");
    SQLite::bind(add_collection, kDefaultCollection, database.getLastInsertRowid(), NowMs());
    add_collection.exec();
    transaction.commit();
  }
  temporary.Unlock();
  Publish(temporary.path(), path, true);
}

void UpgradeDatabase(const fs::path& path, Connection::Mode mode, int busy_timeout_ms) {
  Connection connection(path, mode, busy_timeout_ms);
  if (mode == Connection::Mode::kReadWrite) {
    Migrate(connection.database(), Migrations());
    return;
  }
  const std::int64_t version = connection.Scalar("PRAGMA user_version");
  if (version < SchemaVersion()) {
    throw Error(ErrorCode::kConflict, "old_schema",
                DisplayPath(path) +
                    " was made by an older Pliant and must be opened once for "
                    "writing; `pliant db check` does that");
  }
  Migrate(connection.database(), Migrations());  // only refuses a newer one
}

void BackupDatabase(Connection& source, const fs::path& target) {
  CheckParentDirectory(target);
  const Error exists(ErrorCode::kConflict, "backup_exists",
                     DisplayPath(target) + " exists already; name a new file for the backup");
  std::error_code ignored;
  if (fs::exists(fs::symlink_status(target, ignored))) throw exists;
  RemoveAbandonedBackups(fs::absolute(target).parent_path());
  TemporaryFile temporary(target);
  {
    SQLite::Database copy(fs::absolute(temporary.path()).string(),
                          SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    SQLite::Backup backup(copy, source.database());
    if (backup.executeStep(-1) != SQLITE_DONE) {
      throw SQLite::Exception("the copy could not be finished", SQLITE_BUSY);
    }
  }
  temporary.Unlock();
  if (!Publish(temporary.path(), target, false)) throw exists;
}

}  // namespace pliant
