// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The body of a long answer: written to a file without a name, or a file that is there, from which
// it is sent as fast as the client takes it, so that it is never in memory as a whole and no thread
// waits for the client.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace pliant::server {

// One thread writes it whole; then any number read. The file is gone with the object, also when the
// process is killed.
class BodyFile {
 public:
  // In a directory on a disk, of which `reserve_bytes` stay free. Throws Error: kNoSpace
  // "no_space", kReadOnly "read_only", kInternal "io_error".
  BodyFile(std::filesystem::path directory, std::uint64_t reserve_bytes);
  // A regular file, no link, as it is now; it stays readable when its name is removed. Throws Error
  // kNotFound "file_not_found", and as above.
  explicit BodyFile(const std::filesystem::path& file);
  // `bytes` of another from `first` on; both must be inside it.
  BodyFile(std::shared_ptr<const BodyFile> whole, std::uint64_t first, std::uint64_t bytes);
  ~BodyFile();
  BodyFile(const BodyFile&) = delete;
  BodyFile& operator=(const BodyFile&) = delete;

  void Append(std::string_view bytes);  // throws as the constructor does
  // For one that is written anywhere, until all places below size() are. Throws likewise; Reserve,
  // before, when so many bytes would not fit on the disk.
  void Reserve(std::uint64_t bytes) const;
  void Write(std::uint64_t offset, std::string_view bytes);
  std::uint64_t size() const { return size_; }
  // Of a file that is there: another one, or another state of it, has another.
  const std::string& version() const { return version_; }

  // At most `bytes` from `offset` on; how many, 0 at the end, -1 when it cannot be read.
  std::ptrdiff_t Read(std::uint64_t offset, char* data, std::size_t bytes) const;

 private:
  std::filesystem::path directory_;
  std::uint64_t reserve_bytes_ = 0;
  std::shared_ptr<const BodyFile> whole_;  // this is a part of
  std::uint64_t first_ = 0;                // of the part
  int fd_ = -1;
  std::string version_;
  std::uint64_t size_ = 0;
  std::uint64_t written_ = 0;
  std::uint64_t checked_ = 0;  // written_ when the free space was looked at
};

}  // namespace pliant::server
