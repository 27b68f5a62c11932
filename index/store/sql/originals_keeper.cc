// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sql/originals_keeper.h"

#include <algorithm>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "index/files/text.h"
#include "index/store/refusals.h"
#include "index/store/sql/integrity.h"
#include "index/store/sql/rows.h"

namespace pliant {

void OriginalsKeeper::Open(const std::optional<std::filesystem::path>& directory, bool claim) {
  named_ = directory.value_or("");
  const std::string identity = access_.Identity();
  const bool settled = access_.Read([&](Connection& db) {
    originals_ = Originals(db, identity, directory);
    return originals_.Settled(db, directory);
  });
  if (!claim) return;
  if (!settled) access_.WriteAlone([&](Connection& db) { originals_.Claim(db, directory); });
  if (originals_.owned()) originals_.store()->RemoveAbandoned();
}

std::vector<std::uint8_t> OriginalsKeeper::Read(const std::string& collection,
                                                const std::string& id) {
  std::string directory;
  // A picture that is removed after it was looked up has lost its file when it is looked up again.
  for (int attempt = 0; attempt < 2; ++attempt) {
    ImageRecord record;
    std::optional<std::vector<std::uint8_t>> bytes;
    std::optional<OriginalStore> store;
    access_.Read([&](Connection& db) {
      const PictureRow picture = RequirePicture(db, collection, id);
      record = picture.record;
      bytes = ReadOriginal(db, picture.key);
      if (!bytes && HasOriginalFile(db, picture.key)) store = originals_.Present(db);
    });
    if (bytes) {
      if (Sha256Hex(*bytes) == record.sha256) return *std::move(bytes);
      throw Error(ErrorCode::kCorrupt, "original_corrupt",
                  "the stored bytes of \"" + ToDisplayText(id) +
                      "\" are damaged; remove the picture and add it again");
    }
    if (!store) {
      throw refusals::ContentNotKept(id);
    }
    if (auto file = store->Read(record.sha256, record.bytes)) return *std::move(file);
    directory = store->directory().string();
  }
  throw Error(ErrorCode::kCorrupt, "original_missing",
              "the original of \"" + ToDisplayText(id) + "\" is not in " + directory +
                  "; add the same picture again, or restore the directory");
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
    // The pictures are gone, which is what was asked for. Their files stay noted in the database:
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
  // Pictures that were removed while the files were read look as if they had lost theirs; they are
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

}  // namespace pliant
