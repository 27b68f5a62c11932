// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A directory of uploaded files named by their SHA-256. It only manages files; the database knows
// which of them belong to an image (originals.h). Private to index/.
//
//   DIR/pliant-originals    whose directory it is: two lines, the database's id and its path
//   DIR/incoming/...        files being written, each locked (flock) by its writer
//   DIR/ab/abcd...          64 hex digits, in one of 256 folders by the first two
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "descriptor/image/image.h"
#include "index/files/durable_file.h"

namespace pliant {

// The owner of a directory. Only the owner adds and removes files. So a copy of a database, which
// names the same directory, cannot remove files of the original.
struct OriginalsOwner {
  std::string id;        // of the database: 32 hex digits, made when it first used a directory
  std::string database;  // its absolute path

  friend bool operator==(const OriginalsOwner&, const OriginalsOwner&) = default;
};

// A file that is written and flushed, but not yet under its final name. Removed with the object
// unless it was published.
class IncomingOriginal {
 public:
  // Throws kNoSpace "write_failed", kInternal "io_error".
  IncomingOriginal(const std::filesystem::path& directory, std::string sha256, Bytes bytes);
  ~IncomingOriginal();
  IncomingOriginal(const IncomingOriginal&) = delete;
  IncomingOriginal& operator=(const IncomingOriginal&) = delete;

  const std::string& sha256() const { return sha256_; }

 private:
  friend class OriginalStore;

  const std::string sha256_;
  std::filesystem::path path_;  // empty = published
  const FileHandle file_;
};

// Thread-safe; every method may also be called while other processes use the directory. Call
// Publish and Remove with the database's write lock held. The lock prevents one process from
// removing a file that another is about to refer to.
class OriginalStore {
 public:
  explicit OriginalStore(std::filesystem::path directory) : directory_(std::move(directory)) {}

  const std::filesystem::path& directory() const { return directory_; }

  // nullopt = no owner. Throws kCorrupt "originals_owner_invalid".
  std::optional<OriginalsOwner> Owner() const;
  // Creates a missing directory (not its parents), and makes `owner` its owner.
  void Claim(const OriginalsOwner& owner) const;

  // Replaces a file of that name, which has the same bytes or is damaged. Durable on return.
  void Publish(IncomingOriginal& incoming) const;
  bool Remove(const std::string& sha256) const;  // false = was not there
  // The same if the write lock can be lost: a database server takes it from a stopped program. Then
  // `confirm` must throw, and the file is restored.
  bool RemoveIf(const std::string& sha256, const std::function<void()>& confirm) const;
  std::optional<std::uint64_t> SizeOf(const std::string& sha256) const;  // nullopt = not there
  // Whether the file has that size, and Publish has not failed to make it durable.
  bool Holds(const std::string& sha256, std::uint64_t size) const;

  // Makes the names durable that its folder had when this object was made, because another process
  // can have failed to.
  void Secure(const std::string& sha256) const;

  // nullopt = no such file. Throws kCorrupt "original_corrupt" when it cannot be read, is larger
  // than `size` bytes, or does not have the hash.
  std::optional<std::vector<std::uint8_t>> Read(const std::string& sha256,
                                                std::uint64_t size) const;

  std::vector<std::string> List() const;  // hashes of all published files
  // Removes the files of dead writers in `incoming`, and those of Claim(). Returns their number.
  std::uint64_t RemoveAbandoned() const;

 private:
  // This process's knowledge of the folders.
  class Folders {
   public:
    void Make(const std::filesystem::path& path);   // and durable
    void Flush(const std::filesystem::path& path);  // the names in it
    bool Flushed(const std::filesystem::path& path);
    void FlushOnce(const std::filesystem::path& path);

   private:
    std::mutex mutex_;  // guards what follows
    std::set<std::filesystem::path> durable_;
    std::set<std::filesystem::path> unflushed_;  // folders where that has failed
    std::set<std::filesystem::path> flushed_;    // by FlushOnce
  };

  std::filesystem::path PathOf(const std::string& sha256) const;

  std::filesystem::path directory_;
  std::shared_ptr<Folders> folders_ = std::make_shared<Folders>();  // copies share it
};

}  // namespace pliant
