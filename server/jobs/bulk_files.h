// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Bodies of imports that are too large for the database: files beside it, until their jobs end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "server/http/body_file.h"
#include "server/http/message.h"
#include "server/jobs/job_store.h"

namespace pliant::server {

struct BulkFileOptions {
  std::filesystem::path database = {};  // the files are NAME.import-ID beside it
  std::uint64_t max_bytes = 0;          // of a body; 0 = as the disk has room
  std::uint64_t reserve_bytes = 0;      // of the disk, which bodies may not take
  std::size_t max_item_bytes = 0;       // of one image, or line, in a body
};

// A body on its way from a client. Its file is removed with this, unless Keep() was called.
class BulkUpload final : public BodySink {
 public:
  // `file`: at `path`, locked against Sweep(). Holds `slot`, one of kMostUploads.
  BulkUpload(FileHandle file, std::filesystem::path path, std::string id,
             const BulkFileOptions& options, std::shared_ptr<int> slot);
  ~BulkUpload() override;

  void Append(std::string_view bytes) override;  // throws as BulkFiles::Receive does
  std::string_view All() override;               // of the complete body

  const std::string& id() const { return id_; }  // for BulkFiles::Open
  void Sync();                                   // the file survives power loss
  void Keep() { kept_ = true; }                  // the file belongs to a job now

 private:
  const std::filesystem::path path_;
  const std::string id_;
  const std::uint64_t max_bytes_;
  const std::shared_ptr<int> slot_;
  BodyFile file_;
  bool kept_ = false;
  std::shared_ptr<const std::string_view> mapped_;
};

// Thread-safe. Several servers may share the database, and so the files.
class BulkFiles {
 public:
  static constexpr int kMostUploads = 2;  // at once

  explicit BulkFiles(BulkFileOptions options) : options_(std::move(options)) {}

  std::size_t max_item_bytes() const { return options_.max_item_bytes; }

  // Receives a body of `bytes` (0 = unknown). Throws ProblemError "body_too_large" and "busy", and
  // Error kNoSpace, kReadOnly, kUnavailable "too_many_open_files", kInternal.
  std::shared_ptr<BulkUpload> Receive(std::uint64_t bytes) const;

  // Null if the file does not exist, else its content (MapFile). Throws likewise.
  std::shared_ptr<const std::string_view> Open(const std::string& id) const;
  void Remove(const std::string& id) const;  // no matter whether it exists

  // Removes files of killed servers: files without an upload or an active job, once they are a
  // minute old. Returns their number.
  std::size_t Sweep(const JobStore& jobs) const;

 private:
  std::filesystem::path PathOf(const std::string& id) const;

  const BulkFileOptions options_;
  const std::shared_ptr<int> slots_ = std::make_shared<int>();  // each upload holds a copy
};

}  // namespace pliant::server
