// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bodies of imports that are too large for the database: files beside it, until their jobs end.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "server/http/message.h"
#include "server/jobs/jobs.h"

namespace pliant::server {

struct BulkFileOptions {
  std::filesystem::path database = {};  // the files are NAME.import-ID beside it
  std::uint64_t max_bytes = 0;          // of a body; 0 = as the disk has room
  std::uint64_t reserve_bytes = 0;      // of the disk, which bodies may not take
  std::size_t max_item_bytes = 0;       // of one image, or line, in a body
};

// A file as memory, read from the disk as it is looked at. Immutable.
class MappedFile {
 public:
  // `fd` stays the caller's. Throws Error kInternal "io_error".
  explicit MappedFile(int fd);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::string_view bytes() const { return {static_cast<const char*>(data_), size_}; }

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0;
};

class BulkUpload;

// Thread-safe. Several servers may share the database, and so the files.
class BulkFiles {
 public:
  static constexpr int kMostUploads = 2;  // at once

  explicit BulkFiles(BulkFileOptions options) : options_(std::move(options)) {}

  std::size_t max_item_bytes() const { return options_.max_item_bytes; }

  // What takes a body of `bytes`, 0: of nobody knows how many; it refuses those that are too many
  // ("body_too_large") when they come. Throws ProblemError "body_too_large" and "busy", and Error
  // kNoSpace, kReadOnly, kUnavailable "too_many_open_files", kInternal.
  std::shared_ptr<BulkUpload> Receive(std::uint64_t bytes) const;

  // Null when there is no such file any more. Throws likewise.
  std::unique_ptr<MappedFile> Open(const std::string& id) const;
  void Remove(const std::string& id) const;  // no matter whether it is there

  // Removes what killed servers left: files that nobody writes and no job that has not ended works
  // on, once they are a minute old. How many.
  std::size_t Sweep(JobQueue& jobs) const;

 private:
  std::filesystem::path PathOf(const std::string& id) const;

  const BulkFileOptions options_;
  const std::shared_ptr<std::atomic<int>> uploads_ = std::make_shared<std::atomic<int>>(0);
};

// A body on its way from a client. Its file is gone with it, unless it is kept.
class BulkUpload final : public BodySink {
 public:
  // `uploads` counts it as long as it is there.
  BulkUpload(std::filesystem::path path, std::string id, const BulkFileOptions& options,
             std::shared_ptr<std::atomic<int>> uploads);
  ~BulkUpload() override;

  void Append(std::string_view bytes) override;  // throws as BulkFiles::Receive does
  std::string_view All() override;               // of the complete body

  const std::string& id() const { return id_; }  // for BulkFiles::Open
  void Sync();                                   // it survives power loss
  void Keep() { kept_ = true; }                  // a job has it now

 private:
  const std::filesystem::path path_;
  const std::string id_;
  const std::uint64_t max_bytes_;
  const std::uint64_t reserve_bytes_;
  const std::shared_ptr<std::atomic<int>> uploads_;
  int fd_ = -1;  // locked, so that no sweep takes it
  bool kept_ = false;
  std::uint64_t written_ = 0;
  std::uint64_t looked_ = 0;  // written_ when the disk was looked at
  std::unique_ptr<MappedFile> mapped_;
};

}  // namespace pliant::server
