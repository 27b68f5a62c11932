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
#include "descriptor/base/format_bytes.h"
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

[[noreturn]] void ThrowExists() {
  throw ProblemError("backup_exists", "There is a backup of this name. Give another.");
}

// What the store says of a file that was sent, without telling clients where it lies.
template <typename Work>
void WithProblems(Work&& work) {
  try {
    work();
  } catch (const Error& error) {
    if (error.reason() == "backup_exists") ThrowExists();
    if (error.reason() == "check_stopped") {
      throw ProblemError("stopping", "The server is being stopped.");
    }
    if (error.code() != ErrorCode::kCorrupt) throw;
    std::string detail = "What was sent is damaged.";
    if (error.reason() == "not_a_database") detail = "What was sent is no database of Pliant's.";
    if (error.reason() == "other_schema") detail = "What was sent was made by another Pliant.";
    if (error.reason() == "foreign_schema") {
      detail = "What was sent has tables, views or triggers that are not Pliant's.";
    }
    if (error.reason() == "check_too_long") detail = "What was sent takes too long to be checked.";
    if (error.reason() == "database_truncated") detail = "What was sent is cut short.";
    Problem problem = ProblemError("backup_invalid", detail).problem();
    problem.internal = error.reason() + ": " + error.what();
    throw ProblemError(std::move(problem));
  }
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
  if (!options_.directory.empty()) return;
  throw ProblemError("backups_off",
                     "The operator has named no directory for backups (--backup-dir).");
}

std::vector<BackupFile> Backups::List() const {
  RequireDirectory();
  std::vector<BackupFile> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(options_.directory)) {
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
  if (!IsName(name) || !Stat(options_.directory / name, &file)) ThrowNotFound();
  return file;
}

std::shared_ptr<const BodyFile> Backups::Content(const std::string& name) const {
  RequireDirectory();
  if (!IsName(name)) ThrowNotFound();
  try {
    return std::make_shared<BodyFile>(options_.directory / name);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kNotFound) ThrowNotFound();
    throw;
  }
}

void Backups::Remove(const std::string& name) const {
  Get(name);  // or it is not there, or is no file
  std::error_code error;
  const bool removed = fs::remove(options_.directory / name, error);
  if (!error && !removed) ThrowNotFound();  // somebody was faster
  if (!error) return;
  const bool read_only = error == std::errc::permission_denied ||
                         error == std::errc::operation_not_permitted ||
                         error == std::errc::read_only_file_system;
  throw Error(read_only ? ErrorCode::kReadOnly : ErrorCode::kInternal, "backup_not_removed",
              (options_.directory / name).string() + ": " + error.message());
}

fs::path Backups::PathOfNew(const std::string& name) const {
  RequireDirectory();
  if (!IsName(name)) {
    throw ProblemError("invalid_parameter",
                       "name must be letters, digits, . _ - and end in \".db\".")
        .Parameter("name");
  }
  const fs::path path = options_.directory / name;
  if (fs::exists(fs::symlink_status(path))) ThrowExists();
  return path;
}

std::shared_ptr<BackupUpload> Backups::Receive(const std::string& name, std::uint64_t bytes) const {
  RequireDirectory();
  if (options_.max_bytes > 0 && bytes > options_.max_bytes) {
    throw ProblemError("body_too_large",
                       fmt::format("A backup may have {}.", FormatBytes(options_.max_bytes)));
  }
  const fs::path path = PathOfNew(name);
  const auto give_back = [uploads = uploads_](std::atomic<int>*) { --*uploads; };
  if (++*uploads_ > kMostUploads) {
    --*uploads_;
    throw ProblemError("busy", "Other backups are being uploaded. Try again later.").RetryAfter(30);
  }
  std::unique_ptr<std::atomic<int>, decltype(give_back)> counted(uploads_.get(), give_back);
  auto upload = std::make_shared<BackupUpload>(
      ReceiveBackup(path, bytes, options_.reserve_bytes,
                    [stopped = stopped_] { return stopped->load(); }),
      uploads_);
  counted.release();  // it gives that back itself
  return upload;
}

void BackupUpload::Append(std::string_view bytes) {
  WithProblems([&] { file_->Append(bytes); });
}

void BackupUpload::Publish() {
  WithProblems([&] { file_->Publish(); });
}

JobStatus Backups::Add(JobQueue& jobs, std::string name) const {
  RequireDirectory();
  if (name.empty()) name = NameOfNow();
  PathOfNew(name);  // or it says what is wrong with the name
  return jobs.Add("backup", "", Json{{"name", name}});
}

void Backups::RegisterJob(JobQueue& jobs, Engine& engine) const {
  if (!options_.directory.empty()) {
    const std::uint64_t removed = RemoveAbandonedBackups(options_.directory);
    if (removed > 0) spdlog::info("removed {} incomplete backups", removed);
  }
  JobKind kind;
  kind.run = [directory = options_.directory, &engine](const JobStatus& job, const JobContext&) {
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
