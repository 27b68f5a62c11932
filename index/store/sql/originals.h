// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Storage of uploaded bytes: in the database, or in a directory that the database records. Private
// to index/.
//
// A file is written and flushed before the transaction that refers to it, and gets its name inside
// that transaction. When the last reference is dropped, a transaction after that commit removes the
// file. A process that dies in between leaves an extra file, never a missing one. Sweep removes
// extra files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "index/records/records.h"
#include "index/store/sql/access.h"
#include "index/store/sql/connection.h"
#include "index/store/sql/original_store.h"
#include "index/store/sql/rows.h"

namespace pliant {

class Originals {
 public:
  Originals() = default;
  // Uses the directory that the database records, or reads `directory` instead. Changes nothing.
  Originals(Connection& db, const std::string& database,
            const std::optional<std::filesystem::path>& directory);

  // Whether new originals already go to `directory`, so that Claim has no work.
  bool HasClaimed(Connection& db, const std::optional<std::filesystem::path>& directory) const;
  // Makes `directory` (absent: the recorded one; empty: the database itself) the location of new
  // originals, in the transaction of `db`. Throws kConflict "originals_foreign" for another
  // database's directory, kNotFound "originals_missing" if files of images are missing in it, and
  // kNotFound "no_such_directory".
  void Claim(Connection& db, const std::optional<std::filesystem::path>& directory);

  // Whether the files must be copied to `directory` before Claim: they are in another directory of
  // this database.
  bool AreElsewhere(Connection& db, const std::filesystem::path& directory) const;
  // Makes this database the owner of `directory`, so that it can be filled. The database does not
  // record this before Record. Throws like Claim, except "originals_missing".
  void Prepare(Connection& db, const std::filesystem::path& directory);
  void Record(Connection& db);

  // The present directory of files, which another process can change. nullopt = the database.
  std::optional<OriginalStore> Present(Connection& db) const;

  const OriginalStore* store() const { return store_ ? &*store_ : nullptr; }
  bool owned() const { return owned_; }          // this database can remove files
  bool takes_new() const { return takes_new_; }  // into the directory

  // The flushed file for Keep; nullptr when new originals go into the database.
  std::unique_ptr<IncomingOriginal> Receive(const std::string& sha256, Bytes bytes) const;
  // In the writer's transaction: stores the `bytes` of `image`, which are `incoming` if that is
  // set. They go into the database if another process has moved the files meanwhile.
  void Keep(Connection& db, Key image, Bytes bytes, IncomingOriginal* incoming) const;
  // Removes files without images. In its own transaction (WriteOptions::alone), after the commit
  // that dropped the last image. With other work in the transaction, it would remove files of
  // images whose removal can still be rolled back.
  void RemoveDropped(Connection& db) const;
  // Removes the file unless an image refers to it. Also in its own transaction.
  bool RemoveUnreferenced(Connection& db, const std::string& sha256) const;

 private:
  // `was`: the directory that the database records.
  void TakeOver(Connection& db, const std::string& was);
  void RequireNotForeign(Connection& db);
  bool Moved(Connection& db) const;

  OriginalsOwner self_;
  std::optional<OriginalStore> store_;
  std::string recorded_;  // by the database when this was made or changed it; "" = none
  bool owned_ = false;
  bool takes_new_ = false;
};

// The uploaded bytes of an opened store: stores, reads, restores, cleans up and moves them. Private
// to index/store/. Thread-safe after Open.
class OriginalsKeeper {
 public:
  explicit OriginalsKeeper(Access* access) : access_(*access) {}

  // A program that adds images makes its database the owner of the directory (`claim`). Other
  // programs only read and clean up.
  void Open(const std::optional<std::filesystem::path>& directory, bool claim);

  const Originals& originals() const { return originals_; }
  std::vector<std::uint8_t> Read(const std::string& collection, const std::string& id);
  // Writes the file of a stored image again if it has been lost.
  void Restore(const ImageRecord& stored, Bytes bytes);
  // After a commit that removed or replaced images; the second never fails.
  void RemoveDropped();
  void Tidy();
  void Forget(const std::string& sha256);  // after a failed transaction; never fails
  std::uint64_t Sweep();
  std::vector<std::string> Check();
  std::optional<OriginalsRecord> Describe();
  MoveOriginalsResult Move(const std::filesystem::path& directory,
                           const std::function<void(double)>& progress);

 private:
  // Copies the files of `from` to the directory of `to`, which Prepare has prepared.
  MoveOriginalsResult Carry(const Originals& from, Originals* to,
                            const std::function<void(double)>& progress);
  void CopyFiles(const Originals& from, const Originals& to, const std::string& last,
                 const std::function<void(double)>& progress);

  Access& access_;
  Originals originals_;
  std::filesystem::path named_;  // given on opening; empty = as recorded, or the database
};

}  // namespace pliant
