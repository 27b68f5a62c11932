// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The uploaded bytes of an opened store: kept with a picture, read, restored, tidied, moved.
// Private to index/store/. Thread-safe after Open.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "index/records/records.h"
#include "index/store/sql/access.h"
#include "index/store/sql/originals.h"

namespace pliant {

class OriginalsKeeper {
 public:
  explicit OriginalsKeeper(Access* access) : access_(*access) {}

  // A program that adds pictures makes the directory its own (`claim`); any other only reads and
  // tidies.
  void Open(const std::optional<std::filesystem::path>& directory, bool claim);

  const Originals& originals() const { return originals_; }
  std::vector<std::uint8_t> Read(const std::string& collection, const std::string& id);
  // Writes the file of a stored picture again if it has been lost.
  void Restore(const ImageRecord& stored, Bytes bytes);
  // After a commit that removed or replaced pictures; the second never fails.
  void RemoveDropped();
  void Tidy();
  void Forget(const std::string& sha256);  // after a failed transaction; never fails
  std::uint64_t Sweep();
  std::vector<std::string> Check();
  std::optional<OriginalsRecord> Describe();
  MoveOriginalsResult Move(const std::filesystem::path& directory,
                           const std::function<void(double)>& progress);

 private:
  // The files of `from` into the directory of `to`, which Prepare made ready.
  MoveOriginalsResult Carry(const Originals& from, Originals* to,
                            const std::function<void(double)>& progress);
  void CopyFiles(const Originals& from, const Originals& to, const std::string& last,
                 const std::function<void(double)>& progress);

  Access& access_;
  Originals originals_;
  std::filesystem::path named_;  // by who opened; empty = as recorded, or the database
};

}  // namespace pliant
