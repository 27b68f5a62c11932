// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where an engine keeps uploaded bytes: in the database, or in a directory that the database
// remembers. Private to index/.
//
// A file is written and flushed before the transaction that refers to it, gets its name inside that
// transaction, and loses it in one that comes after the commit that dropped the last reference. A
// process that dies in between leaves a file too many, never one too few; Sweep removes those.
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
  // Follows what the database says, or looks into `directory` instead. Changes nothing.
  Originals(Connection& db, const std::string& database,
            const std::optional<std::filesystem::path>& directory);

  // Whether new originals go where `directory` wants them, and nothing is left to be claimed.
  bool Settled(Connection& db, const std::optional<std::filesystem::path>& directory) const;
  // Makes `directory` (absent: the one the database remembers; empty: the database itself) the
  // place of new originals, in the transaction of `db`. Throws kConflict "originals_foreign" for
  // another database's directory, kNotFound "originals_missing" when the files that images refer
  // to are not in it, and kNotFound "no_such_directory".
  void Claim(Connection& db, const std::optional<std::filesystem::path>& directory);

  // Whether the files are to be copied to `directory` before it is claimed: they are in another
  // one, which is this database's.
  bool AreElsewhere(Connection& db, const std::filesystem::path& directory) const;
  // Makes `directory` this database's, to be filled; the database does not say so before Record.
  // Throws like Claim, but for "originals_missing".
  void Prepare(Connection& db, const std::filesystem::path& directory);
  void Record(Connection& db);

  // Where files are at the moment: another process may have moved them. nullopt = in the database.
  std::optional<OriginalStore> Present(Connection& db) const;

  const OriginalStore* store() const { return store_ ? &*store_ : nullptr; }
  bool owned() const { return owned_; }          // files may be removed
  bool takes_new() const { return takes_new_; }  // into the directory

  // The flushed file for Keep; nullptr when new originals go into the database.
  std::unique_ptr<IncomingOriginal> Receive(const std::string& sha256, Bytes bytes) const;
  // In the writer's transaction: `image` has `bytes`, which are `incoming` if there is one. They
  // go into the database where another process has moved the files meanwhile.
  void Keep(Connection& db, Key image, Bytes bytes, IncomingOriginal* incoming) const;
  // Removes files whose last image is gone. In a transaction of its own (WriteOptions::alone),
  // after the commit that dropped it: in one with others' work it would remove files of images
  // whose removal is not committed, and may never be.
  void RemoveDropped(Connection& db) const;
  // Removes the file unless an image refers to it. In a transaction of its own, too.
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

// The uploaded bytes of an opened store: kept with an image, read, restored, tidied, moved.
// Private to index/store/. Thread-safe after Open.
class OriginalsKeeper {
 public:
  explicit OriginalsKeeper(Access* access) : access_(*access) {}

  // A program that adds images makes the directory its own (`claim`); any other only reads and
  // tidies.
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
