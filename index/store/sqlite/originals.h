// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where an engine keeps uploaded bytes: in the database, or in a directory that the database
// remembers. Private to index/.
//
// A file is written and flushed before the transaction that refers to it, gets its name inside that
// transaction, and loses it in one that comes after the commit that dropped the last reference. A
// process that dies in between leaves a file too many, never one too few; Sweep removes those.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "index/store/sqlite/catalogue_originals.h"
#include "index/store/sqlite/connection.h"
#include "index/store/sqlite/original_store.h"

namespace pliant {

class Originals {
 public:
  Originals() = default;
  // Follows what the database says, or looks into `directory` instead. Changes nothing.
  Originals(Connection& db, const std::filesystem::path& database,
            const std::optional<std::filesystem::path>& directory);

  // Whether new originals go where `directory` wants them, and nothing is left to be claimed.
  bool Settled(Connection& db, const std::optional<std::filesystem::path>& directory) const;
  // Makes `directory` (absent: the one the database remembers; empty: the database itself) the
  // place of new originals, in the transaction of `db`. Throws kConflict "originals_foreign" for
  // another database's directory, kNotFound "originals_missing" when the files that pictures refer
  // to are not in it, and kNotFound "no_such_directory".
  void Claim(Connection& db, const std::optional<std::filesystem::path>& directory);

  const OriginalStore* store() const { return store_ ? &*store_ : nullptr; }
  bool owned() const { return owned_; }          // files may be removed
  bool takes_new() const { return takes_new_; }  // into the directory

  // The flushed file for Keep; nullptr when new originals go into the database.
  std::unique_ptr<IncomingOriginal> Receive(const std::string& sha256, Bytes bytes) const;
  // In the writer's transaction: `picture` has `bytes`, which are `incoming` if there is one.
  void Keep(Connection& db, Key picture, Bytes bytes, IncomingOriginal* incoming) const;
  // Removes files whose last picture is gone. In a transaction of its own (WriteOptions::alone),
  // after the commit that dropped it: in one with others' work it would remove files of pictures
  // whose removal is not committed, and may never be.
  void RemoveDropped(Connection& db) const;
  // Removes the file unless a picture refers to it. In a transaction of its own, too.
  bool RemoveUnreferenced(Connection& db, const std::string& sha256) const;

 private:
  void TakeOver(Connection& db, const OriginalsDirectoryRow& row);

  OriginalsOwner self_;
  std::optional<OriginalStore> store_;
  bool owned_ = false;
  bool takes_new_ = false;
};

}  // namespace pliant
