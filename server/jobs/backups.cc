// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/backups.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <optional>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include "descriptor/base/error.h"
#include "index/files/text.h"
#include "index/store/open_store.h"
#include "server/http/parameters.h"

namespace pliant::server {

namespace {

namespace fs = std::filesystem;

constexpr const char* kSuffix = ".db";
constexpr std::size_t kLongestName = 100;

bool IsName(const std::string& name) {
  return name.size() > 3 && name.size() <= kLongestName && name.ends_with(kSuffix) &&
         name.front() != '.' && IsNameOf(name, "._-");
}

std::string NameOfNow() {
  const auto now = std::chrono::system_clock::now();
  const auto ms =
      std::chrono::duration_cast<std::chrono::milliseconds>(now.time_since_epoch()).count() % 1000;
  return fmt::format("pliant-{:%Y%m%dT%H%M%S}.{:03}Z{}",
                     fmt::gmtime(std::chrono::system_clock::to_time_t(now)), ms, kSuffix);
}

[[noreturn]] void ThrowNotFound() {
  throw ProblemError("backup_not_found", "No backup has this name.");
}

// Nothing if it is no regular file with the name of a backup.
std::optional<BackupFile> Find(const fs::path& path) {
  struct stat info = {};
  const std::string name = path.filename().string();
  if (!IsName(name) || ::lstat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return {};
  return BackupFile{name, static_cast<std::uint64_t>(info.st_size),
                    std::int64_t{info.st_mtim.tv_sec} * 1000 + info.st_mtim.tv_nsec / 1'000'000};
}

}  // namespace

const fs::path& Backups::Directory() const {
  if (directory_.empty()) {
    throw ProblemError("backups_off", "Backups are off. Start the server with --backup-dir DIR.");
  }
  return directory_;
}

std::vector<BackupFile> Backups::List() const {
  std::vector<BackupFile> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(Directory())) {
    if (auto file = Find(entry.path())) files.push_back(*std::move(file));
  }
  std::sort(files.begin(), files.end(), [](const BackupFile& a, const BackupFile& b) {
    return std::pair(b.created_ms, b.name) < std::pair(a.created_ms, a.name);
  });
  return files;
}

BackupFile Backups::Get(const std::string& name) const {
  const fs::path& directory = Directory();
  const auto file = IsName(name) ? Find(directory / name) : std::nullopt;
  if (!file) ThrowNotFound();
  return *file;
}

std::shared_ptr<const BodyFile> Backups::Content(const std::string& name) const {
  Get(name);  // throws if it does not exist
  try {
    return std::make_shared<BodyFile>(directory_ / name);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kNotFound) ThrowNotFound();
    throw;
  }
}

void Backups::Remove(const std::string& name) const {
  Get(name);  // throws if it does not exist
  std::error_code error;
  const bool removed = fs::remove(directory_ / name, error);
  if (!error && !removed) ThrowNotFound();  // another request was faster
  if (!error) return;
  errno = error.value();
  ThrowErrno("cannot remove", directory_ / name);
}

JobStatus Backups::Add(JobStore& jobs, std::string name) const {
  const fs::path& directory = Directory();
  if (name.empty()) name = NameOfNow();
  if (!IsName(name)) {
    ThrowInvalid("name", "name must be at most 100 letters, digits, . _ - and end in \".db\".");
  }
  if (fs::exists(fs::symlink_status(directory / name))) {
    throw ProblemError("backup_exists", "A backup with this name exists. Choose another name.");
  }
  return jobs.Add("backup", "", Json{{"name", name}});
}

void Backups::RegisterJob(JobRunner& runner, Engine& engine) const {
  if (!directory_.empty()) {
    const std::uint64_t removed = RemoveAbandonedBackups(directory_);
    if (removed > 0) spdlog::info("removed {} incomplete backups", removed);
  }
  JobKind kind;
  kind.run = [this, &engine](const JobStatus& job, const JobContext&) {
    const std::string name = job.parameters.at("name");
    const fs::path path = Directory() / name;
    try {
      engine.Backup(path);
    } catch (const Error& error) {
      // The directory is gone, and the text would tell clients its location.
      if (error.code() != ErrorCode::kNotFound) throw;
      throw Error(ErrorCode::kInternal, error.reason(), error.what());
    }
    spdlog::info("backup {} written", name);
    return "/v1/backups/" + name;
  };
  kind.resumes = false;
  runner.Register("backup", std::move(kind));
}

}  // namespace pliant::server
