// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Originals that are stored already, from the database into files and back.
#include "descriptor/base/error.h"
#include "index/store/sqlite/catalogue.h"
#include "index/store/sqlite/originals_keeper.h"

namespace pliant {
namespace {

constexpr int kBatch = 8;  // pictures in memory and in a transaction

// One picture on its way.
struct Moving {
  Key picture = 0;
  std::vector<std::uint8_t> bytes;
  std::unique_ptr<IncomingOriginal> file;  // nullptr: into the database
};

// nullopt: it is gone, or its file is not as it should be.
std::optional<std::vector<std::uint8_t>> BytesOf(Connection& db, const Originals& originals,
                                                 const PictureRow& picture) {
  if (originals.takes_new()) return ReadOriginal(db, picture.key);
  try {
    return originals.store()->Read(picture.record.sha256, picture.record.bytes);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCorrupt) throw;
    return std::nullopt;
  }
}

}  // namespace

MoveOriginalsResult OriginalsKeeper::Move(const std::filesystem::path& directory,
                                          const std::function<void(double)>& progress) {
  Originals target;
  access_.Write([&](Connection& db) {
    target = Originals(db, access_.path(), std::nullopt);
    target.Claim(db, directory);
  });
  MoveOriginalsResult result;
  if (target.store() == nullptr) return result;  // there never was a directory
  const bool from_files = !target.takes_new();
  const auto total = access_.Read(
      [&](Connection& db) { return static_cast<double>(CountOriginals(db, from_files)); });
  Key after = 0;
  while (true) {
    std::vector<Moving> batch;
    const std::vector<Key> keys = access_.Read([&](Connection& db) {
      const std::vector<Key> next = SelectOriginals(db, from_files, after, kBatch);
      for (const Key key : next) {
        const auto picture = FindPictureByKey(db, key);
        if (!picture) continue;
        auto bytes = BytesOf(db, target, *picture);
        if (!bytes) continue;
        Moving moving{key, *std::move(bytes), nullptr};
        moving.file = target.Receive(picture->record.sha256, moving.bytes);
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
            if (!DeleteOriginal(db, moving.picture, from_files)) continue;  // removed meanwhile
            target.Keep(db, moving.picture, moving.bytes, moving.file.get());
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
