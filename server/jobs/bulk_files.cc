// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/bulk_files.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <set>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "descriptor/base/format_bytes.h"
#include "descriptor/base/hex.h"
#include "server/http/body_file.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

namespace fs = std::filesystem;

constexpr const char* kMark = ".import-";
constexpr std::size_t kIdDigits = 32;
constexpr std::uint64_t kLookEvery = 4 * 1024 * 1024;  // bytes between two looks at the disk
constexpr std::chrono::minutes kYoung{1};              // its upload may have made it just now

bool IsId(const std::string& text) {
  return text.size() == kIdDigits && std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

void CheckSize(std::uint64_t bytes, std::uint64_t max_bytes) {
  if (max_bytes == 0 || bytes <= max_bytes) return;
  throw ProblemError("body_too_large",
                     fmt::format("An import may have {}.", FormatBytes(max_bytes)));
}

// Of all jobs that have not ended.
std::set<std::string> IdsInUse(JobQueue& jobs) {
  jobs.LookNow();
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

MappedFile::MappedFile(int fd) {
  struct stat info{};
  if (::fstat(fd, &info) != 0) ThrowFileError("fstat", errno);
  size_ = static_cast<std::size_t>(info.st_size);
  if (size_ == 0) return;
  data_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, fd, 0);
  if (data_ == MAP_FAILED) {
    data_ = nullptr;
    ThrowFileError("mmap", errno);
  }
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
  const auto give_back = [uploads = uploads_](std::atomic<int>*) { --*uploads; };
  if (++*uploads_ > kMostUploads) {
    --*uploads_;
    throw ProblemError("busy", "Other large imports are being sent. Try again later.")
        .RetryAfter(30);
  }
  std::unique_ptr<std::atomic<int>, decltype(give_back)> counted(uploads_.get(), give_back);
  const std::string id = RandomHex(kIdDigits);
  auto upload = std::make_shared<BulkUpload>(PathOf(id), id, options_, uploads_);
  counted.release();  // it gives that back itself
  return upload;
}

std::unique_ptr<MappedFile> BulkFiles::Open(const std::string& id) const {
  if (!IsId(id)) return nullptr;
  const fs::path path = PathOf(id);
  const int fd = ::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0 && errno == ENOENT) return nullptr;
  if (fd < 0) ThrowFileError(path, errno);
  try {
    auto file = std::make_unique<MappedFile>(fd);
    ::close(fd);
    return file;
  } catch (...) {
    ::close(fd);
    throw;
  }
}

void BulkFiles::Remove(const std::string& id) const {
  std::error_code ignored;
  if (IsId(id)) fs::remove(PathOf(id), ignored);
}

std::size_t BulkFiles::Sweep(JobQueue& jobs) const {
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
                       std::shared_ptr<std::atomic<int>> uploads)
    : path_(std::move(path)),
      id_(std::move(id)),
      max_bytes_(options.max_bytes),
      reserve_bytes_(options.reserve_bytes),
      uploads_(std::move(uploads)),
      fd_(::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600)) {
  if (fd_ < 0) ThrowFileError(path_, errno);
  ::flock(fd_, LOCK_EX | LOCK_NB);
}

BulkUpload::~BulkUpload() {
  if (!kept_) ::unlink(path_.c_str());
  ::close(fd_);
  --*uploads_;
}

void BulkUpload::Append(std::string_view bytes) {
  CheckSize(written_ + bytes.size(), max_bytes_);
  if (written_ == 0 || written_ - looked_ >= kLookEvery) {
    RequireDiskSpace(path_.parent_path(), kLookEvery + bytes.size(), reserve_bytes_);
    looked_ = written_;
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
  if (!mapped_) mapped_ = std::make_unique<MappedFile>(fd_);
  return mapped_->bytes();
}

void BulkUpload::Sync() {
  if (::fsync(fd_) != 0) ThrowFileError(path_, errno);
  const fs::path directory = path_.parent_path();
  const int fd = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) ThrowFileError(directory, errno);
  const int failed = ::fsync(fd) == 0 ? 0 : errno;
  ::close(fd);
  if (failed != 0) ThrowFileError(directory, failed);
}

}  // namespace pliant::server
