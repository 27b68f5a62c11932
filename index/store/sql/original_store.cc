// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/original_store.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <fstream>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/replace_file.h"
#include "descriptor/base/sha256.h"
#include "index/files/image_files.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr const char* kOwnerFile = "pliant-originals";
constexpr const char* kNewOwnerFile = "pliant-originals.part-";  // as ReplaceFile has it
constexpr const char* kIncoming = "incoming";
constexpr std::chrono::minutes kClaimTakes{1};  // no longer, by far
constexpr std::size_t kHashDigits = 64;

bool IsHash(const std::string& name) {
  return name.size() == kHashDigits && std::all_of(name.begin(), name.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

// Makes `path`, and its entry in the directory above durable; also where it is there already: who
// made it may have failed to do that, or have died before.
void MakeDirectory(const fs::path& path) {
  if (::mkdir(path.c_str(), 0777) != 0 && errno != EEXIST) {
    ThrowErrno("cannot make the directory", path);
  }
  SyncDirectoryOf(path);
}

}  // namespace

IncomingOriginal::IncomingOriginal(const fs::path& directory, std::string sha256, Bytes bytes)
    : sha256_(std::move(sha256)),
      file_(MakeLockedFile([&] { return directory / kIncoming / (sha256_ + "." + RandomHex(16)); },
                           0666, &path_)) {
  try {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (const std::error_code error = WriteAt(file_.get(), 0, text)) {
      ThrowErrno("cannot write", path_, error.value());
    }
    if (::fsync(file_.get()) != 0) ThrowErrno("cannot flush", path_);
  } catch (...) {
    ::unlink(path_.c_str());
    throw;
  }
}

IncomingOriginal::~IncomingOriginal() {
  if (!path_.empty()) ::unlink(path_.c_str());
}

void OriginalStore::Folders::Make(const fs::path& path) {
  const std::lock_guard lock(mutex_);
  if (durable_.contains(path)) return;
  MakeDirectory(path);
  durable_.insert(path);
}

void OriginalStore::Folders::Flush(const fs::path& path) {
  const std::lock_guard lock(mutex_);
  unflushed_.insert(path);
  SyncPath(path, O_RDONLY | O_DIRECTORY);
  unflushed_.erase(path);
}

bool OriginalStore::Folders::Flushed(const fs::path& path) {
  const std::lock_guard lock(mutex_);
  return !unflushed_.contains(path);
}

void OriginalStore::Folders::FlushOnce(const fs::path& path) {
  {
    const std::lock_guard lock(mutex_);
    if (flushed_.contains(path)) return;
  }
  Make(path);
  Flush(path);
  const std::lock_guard lock(mutex_);
  flushed_.insert(path);
}

fs::path OriginalStore::PathOf(const std::string& sha256) const {
  return directory_ / sha256.substr(0, 2) / sha256;
}

std::optional<OriginalsOwner> OriginalStore::Owner() const {
  std::ifstream file(directory_ / kOwnerFile);
  if (!file) {
    if (FilesAreUsedUp()) ThrowOutOfFiles("cannot read " + (directory_ / kOwnerFile).string());
    return std::nullopt;
  }
  OriginalsOwner owner;
  if (!std::getline(file, owner.id) || !std::getline(file, owner.database) || owner.id.empty()) {
    throw Error(ErrorCode::kCorrupt, "originals_owner_invalid",
                (directory_ / kOwnerFile).string() +
                    " does not say whose directory it is; remove it if it is this database's");
  }
  return owner;
}

void OriginalStore::Claim(const OriginalsOwner& owner) const {
  MakeDirectory(directory_);
  MakeDirectory(directory_ / kIncoming);
  const fs::path file = directory_ / kOwnerFile;
  const std::string text = owner.id + "\n" + owner.database + "\n";
  const std::string_view parts[] = {text};
  if (const std::error_code error = ReplaceFile(file, parts)) {
    ThrowErrno("cannot make", file, error.value());
  }
}

void OriginalStore::Publish(IncomingOriginal& incoming) const {
  const fs::path path = PathOf(incoming.sha256_);
  folders_->Make(path.parent_path());
  if (::rename(incoming.path_.c_str(), path.c_str()) != 0) ThrowErrno("cannot make", path);
  incoming.path_.clear();
  folders_->Flush(path.parent_path());
}

bool OriginalStore::Remove(const std::string& sha256) const {
  const fs::path path = PathOf(sha256);
  if (::unlink(path.c_str()) == 0) return true;
  if (errno != ENOENT) ThrowErrno("cannot remove", path);
  return false;
}

bool OriginalStore::RemoveIf(const std::string& sha256,
                             const std::function<void()>& confirm) const {
  const fs::path path = PathOf(sha256);
  const FileHandle file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.is_open() && errno == ENOENT) return false;
  if (!file.is_open()) ThrowErrno("cannot remove", path);
  const fs::path aside = directory_ / kIncoming / (sha256 + "." + RandomHex(16));
  // Locked, by this process or by the one that has just written it, it is not taken for what a dead
  // writer left.
  if ((::flock(file.get(), LOCK_SH | LOCK_NB) != 0 && errno != EWOULDBLOCK) ||
      ::rename(path.c_str(), aside.c_str()) != 0) {
    ThrowErrno("cannot remove", path);
  }
  try {
    confirm();
  } catch (...) {
    // Another process may have put the same bytes there since.
    if (::link(aside.c_str(), path.c_str()) == 0 || errno == EEXIST) ::unlink(aside.c_str());
    throw;
  }
  ::unlink(aside.c_str());  // what is left there is removed as abandoned
  return true;
}

std::optional<std::uint64_t> OriginalStore::SizeOf(const std::string& sha256) const {
  std::error_code error;  // it is not there
  const std::uintmax_t size = fs::file_size(PathOf(sha256), error);
  if (error) return std::nullopt;
  return size;
}

bool OriginalStore::Holds(const std::string& sha256, std::uint64_t size) const {
  return SizeOf(sha256) == size && folders_->Flushed(PathOf(sha256).parent_path());
}

void OriginalStore::Secure(const std::string& sha256) const {
  folders_->FlushOnce(PathOf(sha256).parent_path());
}

std::optional<std::vector<std::uint8_t>> OriginalStore::Read(const std::string& sha256,
                                                             std::uint64_t size) const {
  const fs::path path = PathOf(sha256);
  std::error_code error;
  if (!fs::exists(path, error) && !error) return std::nullopt;
  std::vector<std::uint8_t> bytes;
  try {
    bytes = ReadFile(path, static_cast<std::int64_t>(size));
  } catch (const Error& reading) {
    if (reading.code() == ErrorCode::kUnavailable) throw;         // no word about the file
    if (!fs::exists(path, error) && !error) return std::nullopt;  // removed meanwhile
    throw Error(ErrorCode::kCorrupt, "original_corrupt", reading.what());
  }
  if (Sha256Hex(bytes) != sha256) {
    throw Error(ErrorCode::kCorrupt, "original_corrupt",
                path.string() +
                    " does not have the hash that is its name; remove it and add the image again");
  }
  return bytes;
}

std::vector<std::string> OriginalStore::List() const {
  std::vector<std::string> hashes;
  try {
    for (const fs::directory_entry& folder : fs::directory_iterator(directory_)) {
      const std::string prefix = folder.path().filename().string();
      if (prefix.size() != 2 || !folder.is_directory()) continue;
      for (const fs::directory_entry& file : fs::directory_iterator(folder.path())) {
        const std::string name = file.path().filename().string();
        if (IsHash(name) && name.starts_with(prefix)) hashes.push_back(name);
      }
    }
  } catch (const fs::filesystem_error& error) {
    ThrowErrno("cannot list", error.path1(), error.code().value());
  }
  std::sort(hashes.begin(), hashes.end());
  return hashes;
}

std::uint64_t OriginalStore::RemoveAbandoned() const {
  std::uint64_t removed = 0;
  std::error_code none;  // no folder, nothing abandoned
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_ / kIncoming, none)) {
    const FileHandle file(::open(entry.path().c_str(), O_RDONLY | O_CLOEXEC));
    if (!file.is_open()) continue;  // published or removed meanwhile
    // Its writer holds the lock, and loses it by ending.
    const bool free = ::flock(file.get(), LOCK_EX | LOCK_NB) == 0;
    if (free && ::unlink(entry.path().c_str()) == 0) ++removed;
  }
  const auto young = fs::file_time_type::clock::now() - kClaimTakes;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_, none)) {
    if (!entry.path().filename().string().starts_with(kNewOwnerFile)) continue;
    const auto written = fs::last_write_time(entry.path(), none);
    if (!none && written < young && ::unlink(entry.path().c_str()) == 0) ++removed;
  }
  return removed;
}

}  // namespace pliant
