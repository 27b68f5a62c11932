// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/originals.h"

#include <algorithm>
#include <system_error>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/sha256.h"
#include "index/files/durable_file.h"
#include "index/files/text.h"
#include "index/store/sql/integrity.h"
#include "index/store/sql/rows.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;

std::string Absolute(const fs::path& path) {
  fs::path clean = fs::absolute(path).lexically_normal();
  if (!clean.has_filename()) clean = clean.parent_path();  // "dir/"
  return clean.string();
}

// Rows: which originals are in the database, and which are files of a directory.
struct OriginalsDirectoryRow {
  std::string path;   // absolute
  std::string owner;  // id that the directory names
  bool active = false;
};

std::optional<OriginalsDirectoryRow> FindOriginalsDirectory(Connection& db) {
  Cursor row = db.Prepare("SELECT path, owner, active FROM originals_directory");
  if (!row.Next()) return std::nullopt;
  return OriginalsDirectoryRow{row.Text(0), row.Text(1), row.Int(2) != 0};
}

void StoreOriginalsDirectory(Connection& db, const OriginalsDirectoryRow& row) {
  db.Prepare(
        "INSERT INTO originals_directory (key, path, owner, active) VALUES (1, ?1, ?2, ?3) "
        "ON CONFLICT (key) DO UPDATE SET path = ?1, owner = ?2, active = ?3")
      .Bind(row.path, row.owner, row.active ? 1 : 0)
      .Run();
}

void InsertOriginal(Connection& db, Key image, Bytes bytes) {
  db.Prepare("INSERT INTO originals (image, data) VALUES (?, ?)").Bind(image, bytes).Run();
}

std::optional<std::vector<std::uint8_t>> ReadOriginal(Connection& db, Key image) {
  Cursor row = db.Prepare("SELECT data FROM originals WHERE image = ?");
  if (!row.Bind(image).Next()) return std::nullopt;
  return row.CopyOfBlob(0);
}

void InsertOriginalFile(Connection& db, Key image, const std::string& sha256) {
  const std::vector<std::uint8_t> hash = HashBytes(sha256);
  db.Prepare("INSERT INTO original_files (image, sha256) VALUES (?, ?)").Bind(image, hash).Run();
}

bool HasOriginalFile(Connection& db, Key image) {
  Cursor row = db.Prepare("SELECT 1 FROM original_files WHERE image = ?");
  return row.Bind(image).Next();
}

// Of any image.
bool IsOriginalFile(Connection& db, const std::string& sha256) {
  const std::vector<std::uint8_t> hash = HashBytes(sha256);
  Cursor row = db.Prepare("SELECT 1 FROM original_files WHERE sha256 = ? LIMIT 1");
  return row.Bind(hash).Next();
}

// Different ones.
std::uint64_t CountOriginalFiles(Connection& db) {
  return static_cast<std::uint64_t>(db.Scalar("SELECT count(DISTINCT sha256) FROM original_files"));
}

// The hash of one; empty: there is none.
std::string AnyOriginalFile(Connection& db) {
  Cursor row = db.Prepare("SELECT sha256 FROM original_files LIMIT 1");
  return row.Next() ? ToHex(row.Blob(0)) : "";
}

// Images after `after`, in order of their keys, whose bytes are in the database (`files` false)
// or in a file. An original has bytes in one place only.
std::vector<Key> SelectOriginals(Connection& db, bool files, Key after, int limit) {
  Cursor row =
      db.Prepare(files ? "SELECT image FROM original_files WHERE image > ? ORDER BY image LIMIT ?"
                       : "SELECT image FROM originals WHERE image > ? ORDER BY image LIMIT ?");
  row.Bind(after, limit);
  std::vector<Key> keys;
  while (row.Next()) keys.push_back(row.Int(0));
  return keys;
}

std::uint64_t CountOriginals(Connection& db, bool files) {
  return static_cast<std::uint64_t>(
      db.Scalar(files ? "SELECT count(*) FROM original_files" : "SELECT count(*) FROM originals"));
}

// False = it is not there (any more).
bool DeleteOriginal(Connection& db, Key image, bool file) {
  return db.Prepare(file ? "DELETE FROM original_files WHERE image = ?"
                         : "DELETE FROM originals WHERE image = ?")
             .Bind(image)
             .Run() > 0;
}

// Files whose last image is gone, and which may still be there.
std::vector<std::string> DroppedOriginals(Connection& db) {
  std::vector<std::string> hashes;
  Cursor row = db.Prepare("SELECT sha256 FROM dropped_originals");
  while (row.Next()) hashes.push_back(ToHex(row.Blob(0)));
  return hashes;
}

void ForgetDroppedOriginal(Connection& db, const std::string& sha256) {
  const std::vector<std::uint8_t> hash = HashBytes(sha256);
  db.Prepare("DELETE FROM dropped_originals WHERE sha256 = ?").Bind(hash).Run();
}

// The row for new originals in `directory`.
OriginalsDirectoryRow Wanted(OriginalsDirectoryRow row, const std::optional<fs::path>& directory) {
  if (!directory) return row;
  row.active = !directory->empty();
  if (row.active) row.path = Absolute(*directory);
  return row;
}

constexpr int kBatch = 8;  // images in memory and in a transaction

// One image on its way.
struct Moving {
  Key image = 0;
  std::vector<std::uint8_t> bytes;
  std::unique_ptr<IncomingOriginal> file;  // nullptr: into the database
};

// nullopt: there is none, or it is not as it should be.
std::optional<std::vector<std::uint8_t>> FileOf(const Originals& originals,
                                                const ImageRecord& image) {
  try {
    return originals.store()->Read(image.sha256, image.bytes);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCorrupt) throw;
    return std::nullopt;
  }
}

// The next images whose originals are files; moves `after` behind them. Empty = no more.
std::vector<ImageRecord> NextInFiles(Connection& db, Key* after) {
  std::vector<ImageRecord> images;
  for (const Key key : SelectOriginals(db, true, *after, kBatch)) {
    if (const auto image = FindImageByKey(db, key)) images.push_back(image->record);
    *after = key;
  }
  return images;
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

bool Originals::HasClaimed(Connection& db, const std::optional<fs::path>& directory) const {
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
    throw Error(ErrorCode::kConflict, "originals_foreign",
                "the directory " + store_->directory().string() +
                    " contains the originals of the database " + owner->database +
                    "; use another directory. If that database no longer exists, or this database "
                    "was moved, first remove the file pliant-originals in the directory");
  }
}

void Originals::TakeOver(Connection& db, const std::string& was) {
  RequireNotForeign(db);
  const std::string sample = AnyOriginalFile(db);
  if (!sample.empty() && !store_->SizeOf(sample)) {
    throw Error(ErrorCode::kNotFound, "originals_missing",
                "the directory " + store_->directory().string() +
                    " does not have the originals of " + std::to_string(CountOriginalFiles(db)) +
                    " images; mount it, move the files there, or name the directory that has them "
                    "with originals_dir (it was " +
                    was + "). If they are lost, `pliant db copy` makes a database without them");
  }
  if (store_->Owner() != self_) store_->Claim(self_);
  owned_ = true;
}

std::unique_ptr<IncomingOriginal> Originals::Receive(const std::string& sha256, Bytes bytes) const {
  if (!takes_new_) return nullptr;
  return std::make_unique<IncomingOriginal>(store_->directory(), sha256, bytes);
}

void Originals::Keep(Connection& db, Key image, Bytes bytes, IncomingOriginal* incoming) const {
  if (incoming == nullptr || Moved(db)) return InsertOriginal(db, image, bytes);
  store_->Publish(*incoming);
  InsertOriginalFile(db, image, incoming->sha256());
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

void OriginalsKeeper::Open(const std::optional<std::filesystem::path>& directory, bool claim) {
  named_ = directory.value_or("");
  const std::string identity = access_.Identity();
  const bool claimed = access_.Read([&](Connection& db) {
    originals_ = Originals(db, identity, directory);
    return originals_.HasClaimed(db, directory);
  });
  if (!claim) return;
  if (!claimed) access_.WriteAlone([&](Connection& db) { originals_.Claim(db, directory); });
  if (originals_.owned()) originals_.store()->RemoveAbandoned();
}

std::vector<std::uint8_t> OriginalsKeeper::Read(const std::string& collection,
                                                const std::string& id) {
  std::string directory;
  // An image that is removed after it was looked up has lost its file when it is looked up again.
  for (int attempt = 0; attempt < 2; ++attempt) {
    ImageRecord record;
    std::optional<std::vector<std::uint8_t>> bytes;
    std::optional<OriginalStore> store;
    access_.Read([&](Connection& db) {
      const ImageRow image = RequireImage(db, collection, id);
      record = image.record;
      bytes = ReadOriginal(db, image.key);
      if (!bytes && HasOriginalFile(db, image.key)) store = originals_.Present(db);
    });
    if (bytes) {
      if (Sha256Hex(*bytes) == record.sha256) return *std::move(bytes);
      throw Error(ErrorCode::kCorrupt, "original_corrupt",
                  "the stored bytes of \"" + ToDisplayText(id) +
                      "\" are damaged; remove the image and add it again");
    }
    if (!store) {
      throw Error(ErrorCode::kNotFound, "content_not_kept",
                  "The uploaded bytes of \"" + Shown(id) + "\" were not stored.");
    }
    if (auto file = store->Read(record.sha256, record.bytes)) return *std::move(file);
    directory = store->directory().string();
  }
  throw Error(ErrorCode::kCorrupt, "original_missing",
              "the original of \"" + ToDisplayText(id) + "\" is not in " + directory +
                  "; add the same image again, or restore the directory");
}

void OriginalsKeeper::Restore(const ImageRecord& stored, Bytes bytes) {
  if (!originals_.owned()) return;
  const auto store = access_.Read([&](Connection& db) {
    return IsOriginalFile(db, stored.sha256) ? originals_.Present(db) : std::nullopt;
  });
  if (!store || store->Holds(stored.sha256, bytes.size())) return;
  IncomingOriginal incoming(store->directory(), stored.sha256, bytes);
  access_.Write([&](Connection& db) {
    if (IsOriginalFile(db, stored.sha256)) store->Publish(incoming);
  });
}

void OriginalsKeeper::RemoveDropped() {
  if (!originals_.owned()) return;
  if (access_.Read([](Connection& db) { return DroppedOriginals(db).empty(); })) return;
  access_.Write([&](Connection& db) { originals_.RemoveDropped(db); }, {.alone = true});
}

void OriginalsKeeper::Tidy() {
  try {
    RemoveDropped();
  } catch (const Error&) {
    // The images are gone, which is what was asked for. Their files stay noted in the database:
    // the next removal, sweep or check tries again, and the check reports what it cannot remove.
  }
}

void OriginalsKeeper::Forget(const std::string& sha256) {
  try {
    access_.Write([&](Connection& db) { originals_.RemoveUnreferenced(db, sha256); },
                  {.alone = true});
  } catch (const Error&) {
    // What failed before is what the caller must hear of; the next sweep finds the file.
  }
}

std::uint64_t OriginalsKeeper::Sweep() {
  if (!originals_.owned() || !access_.writes()) return 0;
  RemoveDropped();
  const OriginalStore store = *access_.Read([&](Connection& db) { return originals_.Present(db); });
  std::uint64_t removed = store.RemoveAbandoned();
  std::vector<std::string> orphans = store.List();
  access_.Read([&](Connection& db) {
    std::erase_if(orphans, [&](const std::string& sha256) { return IsOriginalFile(db, sha256); });
  });
  if (orphans.empty()) return removed;
  access_.Write(
      [&](Connection& db) {  // nobody can begin to refer to one meanwhile
        for (const std::string& sha256 : orphans) {
          removed += originals_.RemoveUnreferenced(db, sha256) ? 1 : 0;
        }
      },
      {.alone = true});
  return removed;
}

std::vector<std::string> OriginalsKeeper::Check() {
  const auto check = [&](Connection& db) {
    const std::optional<OriginalStore> store = originals_.Present(db);
    return CheckOriginalFiles(db, store ? &*store : nullptr);
  };
  std::vector<std::string> problems = access_.Read(check);
  if (problems.empty()) return problems;
  // Images that were removed while the files were read look as if they had lost theirs; they are
  // not there when looked for again.
  const std::vector<std::string> again = access_.Read(check);
  std::erase_if(problems, [&](const std::string& problem) {
    return std::find(again.begin(), again.end(), problem) == again.end();
  });
  return problems;
}

std::optional<OriginalsRecord> OriginalsKeeper::Describe() {
  return access_.Read([&](Connection& db) -> std::optional<OriginalsRecord> {
    if (originals_.store() == nullptr) return std::nullopt;
    return OriginalsRecord{originals_.Present(db)->directory(), CountOriginalFiles(db),
                           originals_.owned()};
  });
}

// Copies all files except `last`. Files that `to` already has are written again, because their
// writer may not have flushed them.
void OriginalsKeeper::CopyFiles(const Originals& from, const Originals& to, const std::string& last,
                                const std::function<void(double)>& progress) {
  const auto total = access_.Read([&](Connection& db) {
    return static_cast<double>(CountOriginals(db, true) + CountOriginals(db, false));
  });
  Key after = 0;
  std::size_t done = 0;
  while (true) {
    std::vector<std::unique_ptr<IncomingOriginal>> batch;
    const std::size_t seen = access_.Read([&](Connection& db) {
      const std::vector<ImageRecord> images = NextInFiles(db, &after);
      for (const ImageRecord& image : images) {
        if (image.sha256 == last) continue;
        if (const auto bytes = FileOf(from, image)) {
          batch.push_back(to.Receive(image.sha256, *bytes));
        }
      }
      return images.size();
    });
    if (seen == 0) return;
    access_.Write([&](Connection& db) {
      for (const auto& file : batch) {
        if (IsOriginalFile(db, file->sha256())) to.store()->Publish(*file);
      }
    });
    done += seen;
    if (progress) progress(static_cast<double>(done) / total);
  }
}

// Who is killed before the record has all files where they were, and after it all where they shall
// be: what is left behind there is not referred to by anybody.
MoveOriginalsResult OriginalsKeeper::Carry(const Originals& from, Originals* to,
                                           const std::function<void(double)>& progress) {
  // It tells others that a directory has the files: comes with the record.
  const std::string last = access_.Read([](Connection& db) { return AnyOriginalFile(db); });
  CopyFiles(from, *to, last, progress);
  MoveOriginalsResult result;
  access_.Write(
      [&](Connection& db) {
        result = {};
        Key after = 0;
        for (auto images = NextInFiles(db, &after); !images.empty();
             images = NextInFiles(db, &after)) {
          for (const ImageRecord& image : images) {
            const bool there =
                image.sha256 != last && to->store()->Holds(image.sha256, image.bytes);
            if (there) to->store()->Secure(image.sha256);
            const auto bytes = there ? std::nullopt : FileOf(from, image);
            if (bytes) to->store()->Publish(*to->Receive(image.sha256, *bytes));
            ++(there || bytes ? result.moved : result.left);
          }
        }
        to->Record(db);
      },
      {.alone = true});
  Key after = 0;
  for (bool more = true; more;) {
    access_.Write(
        [&](Connection& db) {
          const std::vector<ImageRecord> images = NextInFiles(db, &after);
          for (const ImageRecord& image : images) {
            if (to->store()->Holds(image.sha256, image.bytes)) {
              from.store()->Remove(image.sha256);
            }
          }
          more = !images.empty();
        },
        {.alone = true});
  }
  return result;
}

MoveOriginalsResult OriginalsKeeper::Move(const std::filesystem::path& directory,
                                          const std::function<void(double)>& progress) {
  Originals target;
  std::optional<Originals> elsewhere;
  const std::string identity = access_.Identity();
  access_.Write([&](Connection& db) {
    target = Originals(db, identity, std::nullopt);
    // Who opened the database knows better where they are than it does.
    if (!named_.empty() && !AnyOriginalFile(db).empty()) target.Claim(db, named_);
    if (directory.empty() || !target.AreElsewhere(db, directory))
      return target.Claim(db, directory);
    elsewhere = target;
    target.Prepare(db, directory);
  });
  MoveOriginalsResult result;
  if (target.store() == nullptr) return result;  // there never was a directory
  if (elsewhere) result = Carry(*elsewhere, &target, progress);
  const bool from_files = !target.takes_new();
  const auto total = access_.Read([&](Connection& db) {
    return static_cast<double>(CountOriginals(db, from_files) + result.moved + result.left);
  });
  Key after = 0;
  while (true) {
    std::vector<Moving> batch;
    const std::vector<Key> keys = access_.Read([&](Connection& db) {
      const std::vector<Key> next = SelectOriginals(db, from_files, after, kBatch);
      for (const Key key : next) {
        const auto image = FindImageByKey(db, key);
        if (!image) continue;
        auto bytes = from_files ? FileOf(target, image->record) : ReadOriginal(db, key);
        if (!bytes) continue;
        Moving moving{key, *std::move(bytes), nullptr};
        moving.file = target.Receive(image->record.sha256, moving.bytes);
        batch.push_back(std::move(moving));
      }
      return next;
    });
    if (keys.empty()) break;
    after = keys.back();
    result.left += keys.size() - batch.size();
    std::uint64_t moved = 0;
    access_.Write(
        [&](Connection& db) {
          moved = 0;
          for (const Moving& moving : batch) {
            if (!DeleteOriginal(db, moving.image, from_files)) continue;  // removed meanwhile
            target.Keep(db, moving.image, moving.bytes, moving.file.get());
            ++moved;
          }
        },
        {.reclaim = !from_files});
    result.moved += moved;
    if (from_files) {
      access_.Write([&](Connection& db) { target.RemoveDropped(db); }, {.alone = true});
    }
    if (progress) progress(static_cast<double>(result.moved + result.left) / total);
  }
  return result;
}

}  // namespace pliant
