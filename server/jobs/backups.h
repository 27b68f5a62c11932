// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Copies of the database in the directory that the operator names with --backup-dir.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "index/engine/engine.h"
#include "server/http/body_file.h"
#include "server/jobs/job_runner.h"

namespace pliant::server {

struct BackupFile {
  std::string name;
  std::uint64_t bytes = 0;
  std::int64_t created_ms = 0;
};

// Thread-safe.
class Backups {
 public:
  // Without a directory backups are off.
  explicit Backups(std::filesystem::path directory) : directory_(std::move(directory)) {}

  // Newest first. Throw ProblemError "backups_off"; Get also "backup_not_found".
  std::vector<BackupFile> List() const;
  BackupFile Get(const std::string& name) const;
  // Its content, which stays readable when the file is removed. Throws likewise.
  std::shared_ptr<const BodyFile> Content(const std::string& name) const;
  // Throws likewise, and Error kReadOnly.
  void Remove(const std::string& name) const;

  // Starts the job that writes the file `name` (letters, digits, . _ -, ending in ".db"); empty =
  // one with the time in it. Throws ProblemError "invalid_parameter" and "backup_exists".
  JobStatus Add(JobStore& jobs, std::string name) const;

  // Kind "backup". It is not resumed after a restart: it would copy a different state. Incomplete
  // files are removed, here and before the next backup, once they are a minute old. This must
  // outlive the runner.
  void RegisterJob(JobRunner& runner, Engine& engine) const;

 private:
  const std::filesystem::path& Directory() const;  // throws ProblemError "backups_off"

  const std::filesystem::path directory_;
};

}  // namespace pliant::server
