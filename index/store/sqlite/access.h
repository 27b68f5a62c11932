// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The connections of one opened database: a pool that reads, and a queue that writes. Private to
// store/sqlite. Thread-safe. Lets out only Error.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <utility>

#include "index/store/sqlite/connection.h"
#include "index/store/sqlite/sqlite_error.h"
#include "index/store/sqlite/write_queue.h"

namespace pliant {

class Access {
 public:
  Access(std::filesystem::path path, int busy_timeout_ms, std::uint64_t reserve_bytes)
      : path_(std::move(path)),
        busy_timeout_ms_(busy_timeout_ms),
        reserve_bytes_(reserve_bytes),
        file_(FileAt(path_)),
        readers_(std::make_unique<ConnectionPool>(path_, busy_timeout_ms)) {}

  const std::filesystem::path& path() const { return path_; }
  int busy_timeout_ms() const { return busy_timeout_ms_; }

  void BeginWriting(std::function<void()> after_commit);
  bool writes() const { return writer_ != nullptr; }

  // Runs `work` in a read transaction on a connection of the pool.
  template <typename Work>
  auto Read(Work&& work) {
    CheckInPlace();
    return WithDatabaseErrors(path_, [&] {
      const ConnectionPool::Lease db = readers_->Borrow();
      const SQLite::Transaction reading(db->database());
      return work(*db);
    });
  }
  // Runs `work` in the writer's transaction; see WriteQueue::Run. kReadOnly "read_only" before
  // BeginWriting.
  void Write(WriteQueue::Work work, const WriteOptions& options = {});
  // Runs `work` in a transaction of its own connection: before BeginWriting.
  void WriteAlone(const std::function<void(Connection& db)>& work);

  // Throws kNoSpace "no_space" unless `bytes` and the reserve fit on the disk of the directory, by
  // default that of the database.
  void RequireSpace(std::uint64_t bytes, const std::filesystem::path& directory = {}) const;

  ConnectionPool& readers() { return *readers_; }

 private:
  // Device and inode of the database; 0, 0 where there is no file.
  using File = std::pair<std::uint64_t, std::uint64_t>;
  static File FileAt(const std::filesystem::path& path);
  // Throws kCorrupt "database_moved" when the file was removed, renamed or replaced since it was
  // opened: what is written to it would be lost, and its log would damage the one in its place.
  void CheckInPlace() const;

  std::filesystem::path path_;
  int busy_timeout_ms_;
  std::uint64_t reserve_bytes_;
  const File file_;
  // Dies after the readers: the last connection to close puts the log into the database and removes
  // it, which only a writing one can.
  std::unique_ptr<WriteQueue> writer_;
  std::unique_ptr<ConnectionPool> readers_;
};

}  // namespace pliant
