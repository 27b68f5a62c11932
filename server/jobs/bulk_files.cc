// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/bulk_files.h"

#include <cerrno>
#include <chrono>
#include <set>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "descriptor/base/format_bytes.h"
#include "descriptor/base/hex.h"
#include "index/files/durable_file.h"
#include "server/http/body_file.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

namespace fs = std::filesystem;

constexpr const char* kMark = ".import-";
constexpr std::size_t kIdDigits = 32;
constexpr std::uint64_t kCheckEvery = 4 * 1024 * 1024;  // bytes between checks of the free space
constexpr std::chrono::minutes kYoung{1};               // its upload may have made it just now

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

MappedFile::MappedFile(const fs::path& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) ThrowFileError(path, errno);
  struct stat info{};
  bool mapped = ::fstat(fd, &info) == 0;
  size_ = static_cast<std::size_t>(info.st_size);
  if (mapped && size_ > 0) {
    data_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, fd, 0);
    mapped = data_ != MAP_FAILED;
  }
  const int failed = errno;
  ::close(fd);
  if (!mapped) ThrowFileError(path, failed);
}

MappedFile::~MappedFile() {
  if (data_ != nullptr) ::munmap(data_, size_);
}

fs::path BulkFiles::PathOf(const std::string& id) const {
  return fs::absolute(options_.database.string() + kMark + id);
}

std::shared_ptr<BulkUpload> BulkFiles::Receive(std::uint64_t bytes) const {
  CheckSize(bytes, options_.max_bytes);
  RequireDiskSpace(fs::absolute(options_.database).parent_path(), bytes, options_.reserve_bytes);
  std::shared_ptr<int> slot = slots_;
  if (slot.use_count() - 1 > kMostUploads) {  // slots_ itself is one
    throw ProblemError("busy", "Other clients are sending large imports. Try again later.")
        .RetryAfter(30);
  }
  const std::string id = RandomHex(kIdDigits);
  return std::make_shared<BulkUpload>(PathOf(id), id, options_, std::move(slot));
}

std::unique_ptr<MappedFile> BulkFiles::Open(const std::string& id) const {
  std::error_code ignored;
  if (!IsId(id) || !fs::exists(PathOf(id), ignored)) return nullptr;
  return std::make_unique<MappedFile>(PathOf(id));
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
    const int fd = ::open(entry.path().c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    if (fd < 0) continue;
    // Its job was added before the lock was given up.
    const bool unused =
        ::flock(fd, LOCK_EX | LOCK_NB) == 0 && !IdsInUse(jobs).contains(name.substr(prefix.size()));
    if (unused && fs::remove(entry.path(), ignored)) ++removed;
    ::close(fd);
  }
  return removed;
}

BulkUpload::BulkUpload(fs::path path, std::string id, const BulkFileOptions& options,
                       std::shared_ptr<int> slot)
    : path_(std::move(path)),
      id_(std::move(id)),
      options_(options),
      slot_(std::move(slot)),
      fd_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600)) {
  if (fd_ < 0) ThrowFileError(path_, errno);
  ::flock(fd_, LOCK_EX | LOCK_NB);
}

BulkUpload::~BulkUpload() {
  if (!kept_) ::unlink(path_.c_str());
  ::close(fd_);
}

void BulkUpload::Append(std::string_view bytes) {
  CheckSize(written_ + bytes.size(), options_.max_bytes);
  if (written_ == 0 || written_ - checked_ >= kCheckEvery) {
    RequireDiskSpace(path_.parent_path(), kCheckEvery + bytes.size(), options_.reserve_bytes);
    checked_ = written_;
  }
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) ThrowFileError(path_, errno);
    bytes.remove_prefix(static_cast<std::size_t>(n));
    written_ += static_cast<std::uint64_t>(n);
  }
}

std::string_view BulkUpload::All() {
  if (!mapped_) mapped_ = std::make_unique<MappedFile>(path_);
  return mapped_->bytes();
}

void BulkUpload::Sync() {
  SyncPath(path_, O_RDONLY);
  SyncDirectoryOf(path_);
}

}  // namespace pliant::server
