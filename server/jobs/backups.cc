// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/backups.h"

#include <algorithm>
#include <chrono>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include "descriptor/base/error.h"
#include "index/store/open_store.h"

namespace pliant::server {

namespace {

namespace fs = std::filesystem;

constexpr const char* kSuffix = ".db";
constexpr std::size_t kLongestName = 100;

bool IsName(const std::string& name) {
  return name.size() > 3 && name.size() <= kLongestName && name.ends_with(kSuffix) &&
         name.front() != '.' && std::all_of(name.begin(), name.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '.' || c == '_' || c == '-';
         });
}

std::string NameOfNow() {
  const auto now = std::chrono::system_clock::now();
  const auto ms =
      std::chrono::duration_cast<std::chrono::milliseconds>(now.time_since_epoch()).count() % 1000;
  return fmt::format("pliant-{:%Y%m%dT%H%M%S}.{:03}Z{}",
                     fmt::gmtime(std::chrono::system_clock::to_time_t(now)), ms, kSuffix);
}

[[noreturn]] void ThrowNotFound() {
  throw ProblemError("backup_not_found", "There is no backup of this name.");
}

bool Stat(const fs::path& path, BackupFile* file) {
  struct stat info{};
  if (::lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return false;
  file->name = path.filename().string();
  file->bytes = static_cast<std::uint64_t>(info.st_size);
  file->created_ms = std::int64_t{info.st_mtim.tv_sec} * 1000 + info.st_mtim.tv_nsec / 1'000'000;
  return true;
}

}  // namespace

void Backups::RequireDirectory() const {
  if (!directory_.empty()) return;
  throw ProblemError("backups_off",
                     "The operator has named no directory for backups (--backup-dir).");
}

std::vector<BackupFile> Backups::List() const {
  RequireDirectory();
  std::vector<BackupFile> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_)) {
    BackupFile file;
    if (IsName(entry.path().filename().string()) && Stat(entry.path(), &file)) {
      files.push_back(std::move(file));
    }
  }
  std::sort(files.begin(), files.end(), [](const BackupFile& a, const BackupFile& b) {
    return std::pair(b.created_ms, b.name) < std::pair(a.created_ms, a.name);
  });
  return files;
}

BackupFile Backups::Get(const std::string& name) const {
  RequireDirectory();
  BackupFile file;
  if (!IsName(name) || !Stat(directory_ / name, &file)) ThrowNotFound();
  return file;
}

std::shared_ptr<const BodyFile> Backups::Content(const std::string& name) const {
  RequireDirectory();
  if (!IsName(name)) ThrowNotFound();
  try {
    return std::make_shared<BodyFile>(directory_ / name);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kNotFound) ThrowNotFound();
    throw;
  }
}

void Backups::Remove(const std::string& name) const {
  Get(name);  // or it is not there, or is no file
  std::error_code error;
  const bool removed = fs::remove(directory_ / name, error);
  if (!error && !removed) ThrowNotFound();  // somebody was faster
  if (!error) return;
  const bool read_only = error == std::errc::permission_denied ||
                         error == std::errc::operation_not_permitted ||
                         error == std::errc::read_only_file_system;
  throw Error(read_only ? ErrorCode::kReadOnly : ErrorCode::kInternal, "backup_not_removed",
              (directory_ / name).string() + ": " + error.message());
}

fs::path Backups::PathOfNew(const std::string& name) const {
  RequireDirectory();
  if (!IsName(name)) {
    throw ProblemError("invalid_parameter",
                       "name must be letters, digits, . _ - and end in \".db\".")
        .Parameter("name");
  }
  const fs::path path = directory_ / name;
  if (fs::exists(fs::symlink_status(path))) {
    throw ProblemError("backup_exists", "There is a backup of this name. Give another.");
  }
  return path;
}

JobStatus Backups::Add(JobQueue& jobs, std::string name) const {
  RequireDirectory();
  if (name.empty()) name = NameOfNow();
  PathOfNew(name);  // or it says what is wrong with the name
  return jobs.Add("backup", "", Json{{"name", name}});
}

void Backups::RegisterJob(JobQueue& jobs, Engine& engine) const {
  if (!directory_.empty()) {
    const std::uint64_t removed = RemoveAbandonedBackups(directory_);
    if (removed > 0) spdlog::info("removed {} incomplete backups", removed);
  }
  JobKind kind;
  kind.run = [directory = directory_, &engine](const JobStatus& job, const JobContext&) {
    const std::string name = job.parameters.at("name");
    if (directory.empty()) throw ProblemError("backups_off", "Backups are off now (--backup-dir).");
    try {
      engine.Backup(directory / name);
    } catch (const Error& error) {
      // A directory that is gone or cannot be written is the operator's business; the text would
      // tell clients where it lies.
      if (error.code() != ErrorCode::kNotFound) throw;
      throw Error(ErrorCode::kInternal, error.reason(), error.what());
    }
    spdlog::info("backup {} written", name);
    return "/v1/backups/" + name;
  };
  kind.resumes = false;
  jobs.Register("backup", std::move(kind));
}

}  // namespace pliant::server
