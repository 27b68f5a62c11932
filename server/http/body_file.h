// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The body of a long answer in a file: the server sends it as fast as the client takes it, never
// holds it in memory as a whole, and no thread waits for the client.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "index/files/durable_file.h"

namespace pliant::server {

// One thread writes the whole body; then any number of threads read it. A file without a name goes
// with the object, also when the process is killed.
class BodyFile {
 public:
  // A new file without a name, on a disk of which `reserve_bytes` stay free. Throws what ThrowErrno
  // throws.
  BodyFile(const std::filesystem::path& directory, std::uint64_t reserve_bytes);
  // The file is empty, and open for writing.
  BodyFile(FileHandle file, std::filesystem::path directory, std::uint64_t reserve_bytes);
  // A regular file, no link; it stays readable when its name is removed. Throws Error kNotFound
  // "file_not_found", and as above.
  explicit BodyFile(const std::filesystem::path& file);
  // `bytes` of another body from `first` on; both must be inside it.
  BodyFile(std::shared_ptr<const BodyFile> whole, std::uint64_t first, std::uint64_t bytes);

  // These throw as the constructor and RequireDiskSpace do. Reserve only checks that the bytes fit.
  void Append(std::string_view bytes) { Write(size_, bytes); }
  void Reserve(std::uint64_t bytes) const { RequireDiskSpace(directory_, bytes, reserve_bytes_); }
  void Write(std::uint64_t offset, std::string_view bytes);  // until no gap below size() remains
  std::uint64_t size() const { return size_; }
  const std::string& version() const { return version_; }  // differs for each state of a named file

  // Reads up to `bytes` from `offset` on. Returns how many: 0 at the end, -1 on failure.
  std::ptrdiff_t Read(std::uint64_t offset, char* data, std::size_t bytes) const;

 private:
  std::filesystem::path directory_;
  std::uint64_t reserve_bytes_ = 0;
  std::shared_ptr<const BodyFile> whole_;  // null unless this is a part of it
  std::uint64_t first_ = 0;                // byte of whole_
  FileHandle file_;
  std::string version_;
  std::uint64_t size_ = 0;
  std::uint64_t written_ = 0;
  std::uint64_t checked_ = 0;  // written_ at the last check of the free space
};

}  // namespace pliant::server
