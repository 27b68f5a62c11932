// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/chaos/faults/simulated_disk.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <utility>

#include <fcntl.h>

namespace pliant::chaos {
namespace {

namespace fs = std::filesystem;

std::atomic<SimulatedDisk*> watching{nullptr};

const char* NameOf(Calls call) {
  switch (call) {
    case kOpens:
      return "open";
    case kReads:
      return "read";
    case kWrites:
      return "write";
    case kFlushes:
      return "flush";
    case kTruncates:
      return "truncate";
    case kAdds:
      return "make or rename";
    default:
      return "remove";
  }
}

}  // namespace

SimulatedDisk* SimulatedDisk::Watching() { return watching.load(std::memory_order_acquire); }

SimulatedDisk::SimulatedDisk(fs::path root)
    : root_(std::move(root)), prefix_(root_.string() + "/") {
  Image image = ReadImage(root_);
  for (auto& [name, bytes] : image.files) {
    live_.files[name] = std::make_shared<File>(File{std::move(bytes), {}});
  }
  live_.folders = std::move(image.folders);
  durable_ = live_;
  if (watching.exchange(this) != nullptr) std::abort();
}

SimulatedDisk::~SimulatedDisk() { watching = nullptr; }

void SimulatedDisk::Arm(const Fault& fault) {
  const std::lock_guard lock(mutex_);
  fault_ = fault;
  calls_ = 0;
  struck_ = false;
  victim_.clear();
}

std::string SimulatedDisk::victim() const {
  const std::lock_guard lock(mutex_);
  return victim_;
}

bool SimulatedDisk::struck() const {
  const std::lock_guard lock(mutex_);
  return struck_;
}

std::uint64_t SimulatedDisk::calls() const {
  const std::lock_guard lock(mutex_);
  return calls_;
}

void SimulatedDisk::IgnoreFlushes(bool of_files, bool of_directories) {
  const std::lock_guard lock(mutex_);
  ignore_file_flushes_ = of_files;
  ignore_folder_flushes_ = of_directories;
}

bool SimulatedDisk::Holds(const char* path) const {
  const std::string text = path;
  return text.starts_with(prefix_) || text == root_;
}

bool SimulatedDisk::Holds(int fd) const {
  const std::lock_guard lock(mutex_);
  return open_.contains(fd);
}

std::string SimulatedDisk::Relative(const std::string& path) const {
  if (path.size() <= prefix_.size()) return "";
  std::string name = fs::path(path.substr(prefix_.size())).lexically_normal().string();
  while (name.ends_with('/')) name.pop_back();
  return name;
}

SimulatedDisk::Verdict SimulatedDisk::Count(Calls call, const std::string& name) {
  if (off_) return Verdict::kFail;
  if ((fault_.calls & call) == 0) return Verdict::kGo;
  ++calls_;
  if (fault_.at == 0 || calls_ < fault_.at || (calls_ > fault_.at && !fault_.lasting)) {
    return Verdict::kGo;
  }
  if (victim_.empty()) victim_ = std::string(NameOf(call)) + " \"" + name + "\"";
  switch (fault_.kind) {
    case Fault::Kind::kNone:
      return Verdict::kGo;
    case Fault::Kind::kShortWrite:
      struck_ = true;
      return Verdict::kShort;
    case Fault::Kind::kPowerLoss:
      off_ = true;
      [[fallthrough]];
    case Fault::Kind::kError:
      struck_ = true;
      return Verdict::kFail;
  }
  return Verdict::kGo;
}

std::int64_t SimulatedDisk::Make(Calls call, const std::string& name, const Real& real,
                                 const std::function<void()>& record) {
  const bool was_off = off_;
  if (Count(call, name) == Verdict::kFail) {
    if (off_ && !was_off) record();
    errno = off_ ? EIO : fault_.error;
    return -1;
  }
  const std::int64_t result = real();
  if (result >= 0) {
    const int code = errno;
    record();
    errno = code;
  }
  return result;
}

std::int64_t SimulatedDisk::Open(const char* path, int flags, const Real& real) {
  const std::lock_guard lock(mutex_);
  const std::string name = Relative(path);
  const bool is_folder = name.empty() || live_.folders.contains(name);
  const auto there = live_.files.find(name);
  const bool is_new = !is_folder && there == live_.files.end();
  FilePtr file = is_new || is_folder ? nullptr : there->second;
  if (is_new && (flags & O_CREAT) == 0) return real();  // ENOENT, or what it says
  if (!is_new && (flags & O_EXCL) != 0) return real();
  const bool truncates = !is_new && (flags & O_TRUNC) != 0;
  const auto record = [&] {
    if (is_new) {
      file = std::make_shared<File>();
      AddName(name, file);
    } else if (truncates) {
      file->pending.push_back({true, 0, {}});
    }
  };
  const std::int64_t fd = Make(is_new      ? kAdds
                               : truncates ? kTruncates
                                           : kOpens,
                               name, real, record);
  if (fd >= 0) open_[static_cast<int>(fd)] = {file, name};
  return fd;
}

void SimulatedDisk::Close(int fd) {
  const std::lock_guard lock(mutex_);
  open_.erase(fd);
}

std::int64_t SimulatedDisk::Read(int fd, const Real& real) {
  const std::lock_guard lock(mutex_);
  if (off_) return real();
  return Make(kReads, open_.at(fd).name, real, [] {});
}

std::int64_t SimulatedDisk::Write(int fd, const void* data, std::size_t size, std::int64_t at,
                                  const std::function<std::int64_t(std::size_t)>& real) {
  const std::lock_guard lock(mutex_);
  const auto& [file, name] = open_.at(fd);
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  const auto record = [&, to = file](std::size_t written) {
    if (to) to->pending.push_back({false, at, Blob(bytes, bytes + written)});
  };
  const bool was_off = off_;
  const Verdict verdict = Count(kWrites, name);
  if (verdict == Verdict::kFail) {
    if (off_ && !was_off) record(size);
    errno = off_ ? EIO : fault_.error;
    return -1;
  }
  const std::int64_t written = real(verdict == Verdict::kShort ? (size + 1) / 2 : size);
  if (written > 0) record(static_cast<std::size_t>(written));
  return written;
}

std::int64_t SimulatedDisk::Flush(int fd, const Real& real) {
  const std::lock_guard lock(mutex_);
  const OpenFile target = open_.at(fd);
  const bool was_off = off_;
  if (Count(kFlushes, target.name) == Verdict::kFail) {
    if (target.file && !off_ && !was_off) target.file->pending.clear();
    errno = off_ ? EIO : fault_.error;
    return -1;
  }
  if (!target.file) {
    if (!ignore_folder_flushes_) FlushFolder(target.name);
  } else if (!ignore_file_flushes_) {
    for (const Change& change : target.file->pending) ApplyTo(&target.file->durable, change);
    target.file->pending.clear();
  }
  return real();
}

std::int64_t SimulatedDisk::Truncate(int fd, std::int64_t size, const Real& real) {
  const std::lock_guard lock(mutex_);
  const OpenFile target = open_.at(fd);
  return Make(kTruncates, target.name, real, [&] {
    if (target.file) target.file->pending.push_back({true, size, {}});
  });
}

std::int64_t SimulatedDisk::Rename(const char* from, const char* to, const Real& real) {
  const std::lock_guard lock(mutex_);
  return Make(kAdds, Relative(to), real, [&] {
    const std::string old_name = Relative(from);
    const std::string new_name = Relative(to);
    const auto found = live_.files.find(old_name);
    if (found == live_.files.end()) return;
    const FilePtr file = found->second;
    if (FolderOf(old_name) == FolderOf(new_name)) {
      pending_.push_back({++last_number_, FolderOf(new_name), new_name, file, old_name, 0});
      ApplyTo(&live_, pending_.back());
      return;
    }
    AddName(new_name, file);
    RemoveName(old_name, last_number_);
  });
}

std::int64_t SimulatedDisk::Link(const char* from, const char* to, const Real& real) {
  const std::lock_guard lock(mutex_);
  return Make(kAdds, Relative(to), real, [&] {
    const auto found = live_.files.find(Relative(from));
    if (found != live_.files.end()) AddName(Relative(to), FilePtr(found->second));
  });
}

std::int64_t SimulatedDisk::Remove(const char* path, const Real& real) {
  const std::lock_guard lock(mutex_);
  const std::string name = Relative(path);
  if (!live_.files.contains(name) && !live_.folders.contains(name)) return real();  // ENOENT
  return Make(kRemoves, name, real, [&] { RemoveName(name); });
}

std::int64_t SimulatedDisk::MakeFolder(const char* path, const Real& real) {
  const std::lock_guard lock(mutex_);
  const std::string name = Relative(path);
  if (live_.folders.contains(name) || live_.files.contains(name)) return real();  // EEXIST
  return Make(kAdds, name, real, [&] { AddName(name, nullptr); });
}

}  // namespace pliant::chaos
