// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/bulk_files.h"

#include <chrono>
#include <set>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "descriptor/base/format_bytes.h"
#include "descriptor/base/hex.h"
#include "index/files/durable_file.h"
#include "index/files/mapped_file.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

namespace fs = std::filesystem;

constexpr const char* kMark = ".import-";
constexpr std::size_t kIdDigits = 32;
constexpr std::chrono::minutes kYoung{1};  // its upload may have made it just now

bool IsId(std::string_view text) { return text.size() == kIdDigits && FromHex(text); }

void CheckSize(std::uint64_t bytes, std::uint64_t max_bytes) {
  if (max_bytes == 0 || bytes <= max_bytes) return;
  throw ProblemError("body_too_large",
                     "An import can have at most " + FormatBytes(max_bytes) + ".");
}

std::set<std::string> IdsInUse(const JobStore& jobs) {
  std::set<std::string> ids;
  for (const JobStatus& job : jobs.List()) {
    const auto file = job.parameters.find("file");
    if (IsActive(job.state) && file != job.parameters.end() && file->is_string()) {
      ids.insert(file->get<std::string>());
    }
  }
  return ids;
}

}  // namespace

fs::path BulkFiles::PathOf(const std::string& id) const {
  return fs::absolute(options_.database.string() + kMark + id);
}

std::shared_ptr<BulkUpload> BulkFiles::Receive(std::uint64_t bytes) const {
  CheckSize(bytes, options_.max_bytes);
  RequireDiskSpace(fs::absolute(options_.database).parent_path(), bytes, options_.reserve_bytes);
  std::shared_ptr<int> slot = slots_;
  if (slot.use_count() - 1 > kMostUploads) {  // slots_ itself is one
    throw ProblemError("busy", "Other clients are sending large imports. Try again later.",
                       {.retry_after_s = 30});
  }
  std::string id;
  fs::path path;
  const auto next_name = [&] { return PathOf(id = RandomHex(kIdDigits)); };
  FileHandle file = MakeLockedFile(next_name, 0600, &path);
  return std::make_shared<BulkUpload>(std::move(file), path, id, options_, std::move(slot));
}

std::shared_ptr<const std::string_view> BulkFiles::Open(const std::string& id) const {
  std::error_code ignored;
  return IsId(id) && fs::exists(PathOf(id), ignored) ? MapFile(PathOf(id)) : nullptr;
}

void BulkFiles::Remove(const std::string& id) const {
  std::error_code ignored;
  if (IsId(id)) fs::remove(PathOf(id), ignored);
}

std::size_t BulkFiles::Sweep(const JobStore& jobs) const {
  const std::string prefix = options_.database.filename().string() + kMark;
  std::size_t removed = 0;
  std::error_code ignored;
  for (const fs::directory_entry& entry :
       fs::directory_iterator(fs::absolute(options_.database).parent_path(), ignored)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix) || !IsId(name.substr(prefix.size()))) continue;
    std::error_code gone;
    const auto written = entry.last_write_time(gone);
    if (gone || fs::file_time_type::clock::now() - written < kYoung) continue;
    const FileHandle file(::open(entry.path().c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
    // Its job was added before the lock was given up.
    const bool unused = file.is_open() && ::flock(file.get(), LOCK_EX | LOCK_NB) == 0 &&
                        !IdsInUse(jobs).contains(name.substr(prefix.size()));
    if (unused && fs::remove(entry.path(), ignored)) ++removed;
  }
  return removed;
}

BulkUpload::BulkUpload(FileHandle file, fs::path path, std::string id,
                       const BulkFileOptions& options, std::shared_ptr<int> slot)
    : path_(std::move(path)),
      id_(std::move(id)),
      max_bytes_(options.max_bytes),
      slot_(std::move(slot)),
      file_(std::move(file), path_.parent_path(), options.reserve_bytes) {}

BulkUpload::~BulkUpload() {
  if (!kept_) ::unlink(path_.c_str());
}

void BulkUpload::Append(std::string_view bytes) {
  CheckSize(file_.size() + bytes.size(), max_bytes_);
  file_.Append(bytes);
}

std::string_view BulkUpload::All() {
  if (!mapped_) mapped_ = MapFile(path_);
  return *mapped_;
}

void BulkUpload::Sync() {
  SyncPath(path_, O_RDONLY);
  SyncDirectoryOf(path_);
}

}  // namespace pliant::server
