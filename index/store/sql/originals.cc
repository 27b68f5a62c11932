// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/originals.h"

#include <system_error>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "index/files/durable_file.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

std::string Absolute(const fs::path& path) {
  fs::path clean = fs::absolute(path).lexically_normal();
  if (!clean.has_filename()) clean = clean.parent_path();  // "dir/"
  return clean.string();
}

// What the row becomes when `directory` is asked for.
OriginalsDirectoryRow Wanted(OriginalsDirectoryRow row, const std::optional<fs::path>& directory) {
  if (!directory) return row;
  row.active = !directory->empty();
  if (row.active) row.path = Absolute(*directory);
  return row;
}

}  // namespace

Originals::Originals(Connection& db, const std::string& database,
                     const std::optional<fs::path>& directory) {
  self_.database = database;
  const auto row = FindOriginalsDirectory(db);
  if (row) {
    self_.id = row->owner;
    recorded_ = row->path;
  }
  const bool named = directory && !directory->empty();
  if (!row && !named) return;
  store_.emplace(named ? Absolute(*directory) : row->path);
  owned_ = row && store_->Owner() == self_;
  takes_new_ = owned_ && row->active;
}

bool Originals::Settled(Connection& db, const std::optional<fs::path>& directory) const {
  const auto row = FindOriginalsDirectory(db);
  if (!row) return !directory || directory->empty();
  const OriginalsDirectoryRow wanted = Wanted(*row, directory);
  return owned_ && wanted.path == row->path && wanted.active == row->active;
}

void Originals::Claim(Connection& db, const std::optional<fs::path>& directory) {
  const auto row = FindOriginalsDirectory(db);
  if (!row && (!directory || directory->empty())) return;
  const OriginalsDirectoryRow wanted =
      Wanted(row.value_or(OriginalsDirectoryRow{"", RandomHex(32), true}), directory);
  self_.id = wanted.owner;
  store_.emplace(wanted.path);
  owned_ = false;
  takes_new_ = wanted.active;
  if (wanted.active || !AnyOriginalFile(db).empty()) TakeOver(db, row ? row->path : wanted.path);
  StoreOriginalsDirectory(db, wanted);
  recorded_ = wanted.path;
}

bool Originals::AreElsewhere(Connection& db, const fs::path& directory) const {
  std::error_code ignored;  // `directory` is not there yet
  return owned_ && !AnyOriginalFile(db).empty() && Absolute(directory) != store_->directory() &&
         !fs::equivalent(directory, store_->directory(), ignored);
}

void Originals::Prepare(Connection& db, const fs::path& directory) {
  store_.emplace(Absolute(directory));
  takes_new_ = true;
  RequireNotForeign(db);
  store_->Claim(self_);
  owned_ = true;
}

void Originals::Record(Connection& db) {
  StoreOriginalsDirectory(db, {store_->directory().string(), self_.id, true});
  recorded_ = store_->directory().string();
}

bool Originals::Moved(Connection& db) const {
  const auto row = FindOriginalsDirectory(db);
  return row && row->path != recorded_;
}

std::optional<OriginalStore> Originals::Present(Connection& db) const {
  const bool follows = !store_ || store_->directory() == recorded_;
  if (!follows || !Moved(db)) return store_;
  return OriginalStore(FindOriginalsDirectory(db)->path);
}

void Originals::RequireNotForeign(Connection& db) {
  CheckParentDirectory(store_->directory());
  auto owner = store_->Owner();
  // Of a claim that was cut off before its commit: this database is named, and has forgotten it.
  // With files in it, it is a directory of an older database of this name, which they may come
  // from.
  if (owner && owner->database == self_.database && !FindOriginalsDirectory(db) &&
      store_->List().empty()) {
    owner.reset();
  }
  if (owner && *owner != self_) {
    throw Error(
        ErrorCode::kConflict, "originals_foreign",
        "the directory " + DisplayPath(store_->directory()) +
            " holds the originals of the database " + owner->database +
            ", which would be lost to it; name another directory. If that database is gone, "
            "or is this one and was moved, remove the file pliant-originals in the "
            "directory first");
  }
}

void Originals::TakeOver(Connection& db, const std::string& was) {
  RequireNotForeign(db);
  const std::string sample = AnyOriginalFile(db);
  if (!sample.empty() && !store_->SizeOf(sample)) {
    throw Error(
        ErrorCode::kNotFound, "originals_missing",
        "the directory " + DisplayPath(store_->directory()) + " does not have the originals of " +
            std::to_string(CountOriginalFiles(db)) +
            " pictures; mount it, move the files there, or name the directory that has them "
            "with originals_dir (it was " +
            was + ")");
  }
  if (store_->Owner() != self_) store_->Claim(self_);
  owned_ = true;
}

std::unique_ptr<IncomingOriginal> Originals::Receive(const std::string& sha256, Bytes bytes) const {
  if (!takes_new_) return nullptr;
  return std::make_unique<IncomingOriginal>(store_->directory(), sha256, bytes);
}

void Originals::Keep(Connection& db, Key picture, Bytes bytes, IncomingOriginal* incoming) const {
  if (incoming == nullptr || Moved(db)) return InsertOriginal(db, picture, bytes);
  store_->Publish(*incoming);
  InsertOriginalFile(db, picture, incoming->sha256());
}

void Originals::RemoveDropped(Connection& db) const {
  if (!owned_) return;
  for (const std::string& sha256 : DroppedOriginals(db)) {
    RemoveUnreferenced(db, sha256);
    ForgetDroppedOriginal(db, sha256);
  }
}

bool Originals::RemoveUnreferenced(Connection& db, const std::string& sha256) const {
  if (!owned_ || IsOriginalFile(db, sha256)) return false;
  const std::optional<OriginalStore> store = Present(db);
  if (db.KeepsItsTurn()) return store->Remove(sha256);
  // A statement that succeeds says that nobody else had a turn since the first one.
  return store->RemoveIf(sha256, [&] { IsOriginalFile(db, sha256); });
}

}  // namespace pliant
