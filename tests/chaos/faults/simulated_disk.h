// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A disk that can lose power, fill up and fail. It watches one folder: the calls that change or
// read files there (system_calls.cc hands them over) go to the real file system, and beside it the
// disk keeps what would be left if power went: what was flushed, and no more than POSIX promises.
//
// What is durable: the bytes of a file up to its last fsync; the names in a directory (new files,
// renames, removals, new directories) up to the last fsync of that directory. A rename is one
// change: never are both names gone. A flush that fails loses what it should have written, also
// for later flushes, as on Linux. SQLite's -shm file is gone after power loss.
//
// Thread-safe. One at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include <sys/types.h>

namespace pliant::chaos {

using Blob = std::vector<std::uint8_t>;

// A folder's files and folders, by their paths relative to it.
struct Image {
  std::map<std::string, Blob> files;
  std::set<std::string> folders;
};
Image ReadImage(const std::filesystem::path& folder);
// `folder` then holds this and nothing else.
void WriteImage(const Image& image, const std::filesystem::path& folder);

// Kinds of calls, as bits.
enum Calls : unsigned {
  kOpens = 1,    // of a file that is there
  kReads = 2,    // read, pread
  kWrites = 4,   // write, pwrite
  kFlushes = 8,  // fsync, fdatasync, of files and directories
  kTruncates = 16,
  kAdds = 32,     // open that creates, mkdir, rename, link
  kRemoves = 64,  // unlink, rmdir
  kChanges = kWrites | kFlushes | kTruncates | kAdds | kRemoves,
  kGrows = kWrites | kFlushes | kAdds,  // what a full disk refuses
};

// Of what is not flushed when power goes.
enum class Keep {
  kNothing,
  kEverything,  // as after kill -9
  kPart,        // sectors at random; of each directory's changes, the first few
};

struct Fault {
  enum class Kind { kNone, kPowerLoss, kError, kShortWrite };
  Kind kind = Kind::kNone;
  unsigned calls = kChanges;  // that are counted, and that fail
  std::uint64_t at = 0;       // the first that fails, from 1
  bool lasting = false;       // kError: so do all that follow
  int error = 0;              // kError: errno
};

class SimulatedDisk {
 public:
  // What lies in `root` is durable.
  explicit SimulatedDisk(std::filesystem::path root);
  ~SimulatedDisk();
  SimulatedDisk(const SimulatedDisk&) = delete;
  SimulatedDisk& operator=(const SimulatedDisk&) = delete;

  void Arm(const Fault& fault);  // counts from 0 again
  void Disarm() { Arm({}); }
  bool struck() const;          // the fault has happened
  std::string victim() const;   // the call that it has struck first: "write a.db-wal"
  std::uint64_t calls() const;  // counted since Arm
  // Flushes succeed and do nothing from now on, of files or of directories: to see that the
  // campaign notices.
  void IgnoreFlushes(bool of_files, bool of_directories);

  // What is there after power loss: now, or when it happened.
  Image AfterPowerLoss(Keep keep, std::uint64_t seed) const;

  // For system_calls.cc. `real` makes the system call.
  static SimulatedDisk* Watching();
  using Real = std::function<std::int64_t()>;
  bool Holds(const char* path) const;
  bool Holds(int fd) const;
  std::int64_t Open(const char* path, int flags, const Real& real);
  void Close(int fd);
  std::int64_t Read(int fd, const Real& real);
  std::int64_t Write(int fd, const void* data, std::size_t size, std::int64_t at,
                     const std::function<std::int64_t(std::size_t)>& real);
  std::int64_t Flush(int fd, const Real& real);
  std::int64_t Truncate(int fd, std::int64_t size, const Real& real);
  std::int64_t Rename(const char* from, const char* to, const Real& real);
  std::int64_t Link(const char* from, const char* to, const Real& real);
  std::int64_t Remove(const char* path, const Real& real);
  std::int64_t MakeFolder(const char* path, const Real& real);

 private:
  struct Change {  // of a file's bytes
    bool truncates = false;
    std::int64_t at = 0;  // or the new size
    Blob data;
  };
  struct File {
    Blob durable;
    std::vector<Change> pending;
  };
  using FilePtr = std::shared_ptr<File>;
  struct Names {
    std::map<std::string, FilePtr> files;
    std::set<std::string> folders;
  };
  struct NameChange {
    std::uint64_t number = 0;
    std::string folder;       // whose flush makes it durable
    std::string add;          // or empty
    FilePtr file;             // of `add`; nullptr: a folder
    std::string remove;       // or empty
    std::uint64_t needs = 0;  // the number of the change that must be durable first
  };
  struct OpenFile {
    FilePtr file;  // nullptr: a directory
    std::string name;
  };
  enum class Verdict { kGo, kFail, kShort };

  Verdict Count(Calls call, const std::string& name);
  // Counts, fails or makes the call; `record` notes it. A call that power loss cuts is noted, not
  // made: it may have had an effect.
  std::int64_t Make(Calls call, const std::string& name, const Real& real,
                    const std::function<void()>& record);
  std::string Relative(const std::string& path) const;
  static std::string FolderOf(const std::string& name);
  void AddName(const std::string& name, FilePtr file);
  void RemoveName(const std::string& name, std::uint64_t needs = 0);
  void FlushFolder(const std::string& folder);
  static void ApplyTo(Names* names, const NameChange& change);
  static void ApplyTo(Blob* bytes, const Change& change);

  const std::filesystem::path root_;
  const std::string prefix_;
  mutable std::mutex mutex_;  // guards what follows
  Fault fault_;
  std::uint64_t calls_ = 0;
  bool struck_ = false;
  std::string victim_;
  bool off_ = false;  // power is lost
  bool ignore_file_flushes_ = false;
  bool ignore_folder_flushes_ = false;
  Names live_;
  Names durable_;
  std::vector<NameChange> pending_;
  std::uint64_t last_number_ = 0;
  std::map<int, OpenFile> open_;
};

}  // namespace pliant::chaos
