// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Copies of the database in the directory that the operator names with --backup-dir.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "index/engine/engine.h"
#include "index/store/incoming_backup.h"
#include "server/http/body_file.h"
#include "server/http/message.h"
#include "server/jobs/jobs.h"

namespace pliant::server {

struct BackupFile {
  std::string name;
  std::uint64_t bytes = 0;
  std::int64_t created_ms = 0;
};

struct BackupOptions {
  std::filesystem::path directory = {};  // empty = backups are off
  std::uint64_t max_bytes = 0;           // of one that is uploaded; 0 = as the disk has room
  std::uint64_t reserve_bytes = 0;       // of the disk, which uploads may not take
};

class BackupUpload;

// Thread-safe.
class Backups {
 public:
  static constexpr int kMostUploads = 2;  // at once

  explicit Backups(BackupOptions options) : options_(std::move(options)) {}

  // Newest first. Throw ProblemError "backups_off"; Get also "backup_not_found".
  std::vector<BackupFile> List() const;
  BackupFile Get(const std::string& name) const;
  // Its content, which stays readable when the file is removed. Throws likewise.
  std::shared_ptr<const BodyFile> Content(const std::string& name) const;
  // Throws likewise, and Error kReadOnly.
  void Remove(const std::string& name) const;

  // What takes a backup of `bytes` that a client sends. Throws ProblemError "backups_off",
  // "invalid_parameter", "backup_exists", "body_too_large" and "busy", and Error kNoSpace.
  std::shared_ptr<BackupUpload> Receive(const std::string& name, std::uint64_t bytes) const;

  // Ends the checks of uploads that run, soon, and of those that come.
  void Stop() const { stopped_->store(true); }

  // Starts the job that writes the file `name` (letters, digits, . _ -, ending in ".db"); empty =
  // one with the time in it. Throws ProblemError "invalid_parameter" and "backup_exists".
  JobStatus Add(JobQueue& jobs, std::string name) const;

  // Kind "backup". It is not resumed after a restart: it would copy a different state. What was
  // left incomplete is removed, here and before the next backup, once it is a minute old.
  void RegisterJob(JobQueue& jobs, Engine& engine) const;

 private:
  void RequireDirectory() const;
  std::filesystem::path PathOfNew(const std::string& name) const;

  const BackupOptions options_;
  const std::shared_ptr<std::atomic<int>> uploads_ = std::make_shared<std::atomic<int>>(0);
  const std::shared_ptr<std::atomic<bool>> stopped_ = std::make_shared<std::atomic<bool>>(false);
};

// A backup on its way from a client.
class BackupUpload final : public BodySink {
 public:
  // `uploads` counts it as long as it is there.
  BackupUpload(std::unique_ptr<IncomingBackup> file, std::shared_ptr<std::atomic<int>> uploads)
      : file_(std::move(file)), uploads_(std::move(uploads)) {}
  ~BackupUpload() override { --*uploads_; }

  // Both throw ProblemError "backup_invalid", and Error kNoSpace.
  void Append(std::string_view bytes) override;
  // Checks it and gives it its name. Throws also ProblemError "backup_exists" and "stopping".
  void Publish();

 private:
  std::unique_ptr<IncomingBackup> file_;
  std::shared_ptr<std::atomic<int>> uploads_;
};

}  // namespace pliant::server
