// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Originals that are stored already, from the database into files and back.
#include "descriptor/base/error.h"
#include "index/store/sql/originals.h"
#include "index/store/sql/rows.h"

namespace pliant {
namespace {

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

// All but `last`. What is in `to` already is written again: whoever put it there may not have
// flushed it.
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
