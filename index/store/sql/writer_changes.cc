// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Writer: changing what is stored without describing it anew.
#include "descriptor/base/unix_time.h"
#include "index/files/names.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"
#include "index/store/sql/catalogue_vocabularies.h"
#include "index/store/writer.h"

namespace pliant {
namespace {

// What a moved picture is written again with: MovePicture gives it a new key.
std::uint64_t StoredBytes(Connection& db, const PictureRow& picture) {
  Cursor row = db.Prepare(
      "SELECT coalesce((SELECT length(data) FROM features WHERE picture = ?1), 0) + "
      "coalesce((SELECT length(data) FROM originals WHERE picture = ?1), 0)");
  return static_cast<std::uint64_t>(row.Bind(picture.key).One().Int(0));
}

// The smaller of the two moves into the larger; the object that is left has the name.
void Merge(Access& access, Connection& db, Key collection, Key one, Key other,
           const std::string& name) {
  const bool into_one = CountPicturesOf(db, one) >= CountPicturesOf(db, other);
  const Key kept = into_one ? one : other;
  const Key gone = into_one ? other : one;
  const std::vector<PictureRow> moved = PicturesOf(db, gone);
  std::uint64_t bytes = 0;
  for (const PictureRow& picture : moved) bytes += StoredBytes(db, picture);
  access.RequireSpace(bytes);
  // The last picture to go takes its object along, and with it the name.
  for (PictureRow picture : moved) {
    picture.record.updated_ms = NowMs();
    MovePicture(db, collection, picture, kept);
  }
  RenameObject(db, kept, name);
}

bool SameRecord(const ImageRecord& a, const ImageRecord& b) {
  return a.object == b.object && a.metadata == b.metadata && a.source == b.source;
}

void Change(Access& access, Connection& db, Key collection, PictureRow picture,
            const ImageRecord& changed) {
  if (changed.metadata != picture.record.metadata || changed.source != picture.record.source) {
    DescribePicture(db, picture.key, changed);
  }
  picture.record = changed;
  const Key object = FindOrInsertObject(db, collection, changed.object);
  if (object == picture.object) return;
  access.RequireSpace(StoredBytes(db, picture));
  MovePicture(db, collection, picture, object);
}

}  // namespace

void CheckObjectNow(Connection& db, Key collection, const ObjectRecord& now,
                    const ObjectCheck& check) {
  const ListOptions first{/*collection=*/{}, now.object, /*after_id=*/{}, /*limit=*/1};
  check(now, SelectPictures(db, collection, first).at(0).id);
}

ImageRecord Writer::ChangePicture(const std::string& collection, const std::string& id,
                                  const PictureChange& change) {
  access_.RequireSpace(change.metadata ? change.metadata->size() : 0);
  ImageRecord changed;
  access_.Write([&](Connection& db) {
    const PictureRow picture = RequirePicture(db, collection, id);
    if (change.check) change.check(picture.record);
    changed = picture.record;
    if (change.object) changed.object = *change.object;
    if (change.source) changed.source = *change.source;
    if (change.metadata) changed.metadata = MergeMetadata(changed.metadata, *change.metadata);
    if (!SameRecord(changed, picture.record)) changed.updated_ms = NowMs();
    Change(access_, db, RequireCollection(db, collection).key, picture, changed);
  });
  return changed;
}

CollectionRecord Writer::ChangeCollection(const std::string& name, const CollectionChange& change) {
  access_.RequireSpace(0);
  CollectionRecord changed;
  access_.Write([&](Connection& db) {
    const Key key = RequireCollection(db, name).key;
    if (change.display_name) SetDisplayName(db, key, *change.display_name);
    changed = RecordOf(db, RequireCollection(db, name));
  });
  return changed;
}

void Writer::ChangeAliases(const AliasChanges& changes) {
  access_.RequireSpace(0);
  access_.Write([&](Connection& db) { pliant::ChangeAliases(db, changes); });
}

ObjectRecord Writer::ChangeObject(const std::string& collection, const std::string& object,
                                  const ObjectChange& change) {
  access_.RequireSpace(0);
  ObjectRecord changed;
  const auto write = [&](Connection& db) {
    const Key in = RequireCollection(db, collection).key;
    const Key key = FindObject(db, in, object);
    if (key == 0) {
      throw refusals::NoObject(object);
    }
    changed = {object, CountPicturesOf(db, key)};
    if (change.check) CheckObjectNow(db, in, changed, change.check);
    if (change.name == object) return;
    changed.object = change.name;
    const Key taken = FindObject(db, in, change.name);
    if (taken == 0) {
      RenameObject(db, key, change.name);
      return;
    }
    const std::uint64_t there = CountPicturesOf(db, taken);
    if (!change.merge) {
      throw refusals::ObjectExists(change.name, there);
    }
    Merge(access_, db, in, key, taken, change.name);
    changed.images += there;
  };
  if (change.merge) {
    access_.Write(write, {.reclaim = true, .alone = true});  // as much may move as there is
  } else {
    access_.Write(write);
  }
  return changed;
}

}  // namespace pliant
