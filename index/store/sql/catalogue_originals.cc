// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/catalogue_originals.h"

#include "descriptor/base/hex.h"

namespace pliant {
namespace {

std::vector<std::uint8_t> HashBytes(const std::string& hex) {
  return FromHex(hex).value_or(std::vector<std::uint8_t>{});  // one that is none matches nothing
}

}  // namespace

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

void InsertOriginal(Connection& db, Key picture, Bytes bytes) {
  db.Prepare("INSERT INTO originals (picture, data) VALUES (?, ?)").Bind(picture, bytes).Run();
}

std::optional<std::vector<std::uint8_t>> ReadOriginal(Connection& db, Key picture) {
  Cursor row = db.Prepare("SELECT data FROM originals WHERE picture = ?");
  if (!row.Bind(picture).Next()) return std::nullopt;
  return row.CopyOfBlob(0);
}

void InsertOriginalFile(Connection& db, Key picture, const std::string& sha256) {
  const std::vector<std::uint8_t> hash = HashBytes(sha256);
  db.Prepare("INSERT INTO original_files (picture, sha256) VALUES (?, ?)")
      .Bind(picture, hash)
      .Run();
}

bool HasOriginalFile(Connection& db, Key picture) {
  Cursor row = db.Prepare("SELECT 1 FROM original_files WHERE picture = ?");
  return row.Bind(picture).Next();
}

bool IsOriginalFile(Connection& db, const std::string& sha256) {
  const std::vector<std::uint8_t> hash = HashBytes(sha256);
  Cursor row = db.Prepare("SELECT 1 FROM original_files WHERE sha256 = ? LIMIT 1");
  return row.Bind(hash).Next();
}

std::uint64_t CountOriginalFiles(Connection& db) {
  return static_cast<std::uint64_t>(db.Scalar("SELECT count(DISTINCT sha256) FROM original_files"));
}

std::string AnyOriginalFile(Connection& db) {
  Cursor row = db.Prepare("SELECT sha256 FROM original_files LIMIT 1");
  return row.Next() ? ToHex(row.Blob(0)) : "";
}

std::vector<Key> SelectOriginals(Connection& db, bool files, Key after, int limit) {
  Cursor row = db.Prepare(
      files ? "SELECT picture FROM original_files WHERE picture > ? ORDER BY picture LIMIT ?"
            : "SELECT picture FROM originals WHERE picture > ? ORDER BY picture LIMIT ?");
  row.Bind(after, limit);
  std::vector<Key> keys;
  while (row.Next()) keys.push_back(row.Int(0));
  return keys;
}

std::uint64_t CountOriginals(Connection& db, bool files) {
  return static_cast<std::uint64_t>(
      db.Scalar(files ? "SELECT count(*) FROM original_files" : "SELECT count(*) FROM originals"));
}

bool DeleteOriginal(Connection& db, Key picture, bool file) {
  return db.Prepare(file ? "DELETE FROM original_files WHERE picture = ?"
                         : "DELETE FROM originals WHERE picture = ?")
             .Bind(picture)
             .Run() > 0;
}

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

}  // namespace pliant
