// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/writer.h"

#include <algorithm>
#include <memory>
#include <optional>

#include "descriptor/base/error.h"
#include "descriptor/base/unix_time.h"
#include "index/files/names.h"
#include "index/files/text.h"
#include "index/store/blob_codec.h"
#include "index/store/refusals.h"
#include "index/store/sql/access.h"
#include "index/store/sql/originals.h"
#include "index/store/sql/rows.h"

namespace pliant {
namespace {

Key FindOrInsertObject(Connection& db, Key collection, const std::string& name) {
  if (name.empty()) return 0;
  if (const Key found = FindObject(db, collection, name)) return found;
  return db
      .Prepare(
          "INSERT INTO objects (collection, name, natural_name) VALUES (?, ?, ?) RETURNING key")
      .Bind(collection, name, NaturalKey(name))
      .One()
      .Int(0);
}

void RenameObject(Connection& db, Key object, const std::string& name) {
  db.Prepare("UPDATE objects SET name = ?, natural_name = ? WHERE key = ?")
      .Bind(name, NaturalKey(name), object)
      .Run();
}

// What a moved image is written again with: MoveImage gives it a new key.
std::uint64_t StoredBytes(Connection& db, const ImageRow& image) {
  Cursor row = db.Prepare(
      "SELECT coalesce((SELECT length(data) FROM features WHERE image = ?1), 0) + "
      "coalesce((SELECT length(data) FROM originals WHERE image = ?1), 0)");
  return static_cast<std::uint64_t>(row.Bind(image.key).One().Int(0));
}

// Moves the images to other collections, where they get words of the active vocabulary.
class CollectionMove {
 public:
  CollectionMove(Connection& db, const CollectionRow& to) : db_(db), to_(to) {
    if (to.active_vocabulary != 0) quantizer_.emplace(ReadVocabulary(db, to.active_vocabulary));
  }

  // Throws kConflict "image_exists".
  void Move(const ImageRow& image, Key object) {
    if (KeyOfImage(db_, to_.key, image.record.id) != 0) {
      throw Error(ErrorCode::kConflict, "image_exists",
                  "The collection \"" + to_.name + "\" already has an image \"" + image.record.id +
                      "\". Nothing was moved.");
    }
    const Key key = MoveImage(db_, to_.key, image, object);
    db_.Prepare("DELETE FROM image_words WHERE image = ?").Bind(key).Run();
    if (!quantizer_) return;
    const Features features = DecodeFeatures(ReadFeaturesBlob(db_, key));
    InsertImageWords(db_, to_.active_vocabulary, key,
                     quantizer_->Assign(features.descriptors, /*threads=*/1));
  }

 private:
  Connection& db_;
  const CollectionRow& to_;
  std::optional<Quantizer> quantizer_;
};

std::vector<ImageRow> ImagesOfObject(Access& access, Connection& db, Key object) {
  std::vector<ImageRow> images;
  Cursor row = db.Prepare(kSelectImage + "WHERE p.object = ? ORDER BY p.id");
  row.Bind(object);
  while (row.Next()) images.push_back(ToImage(row));
  std::uint64_t bytes = 0;
  for (const ImageRow& image : images) bytes += StoredBytes(db, image);
  access.RequireSpace(bytes);
  return images;
}

void MoveObject(Access& access, Connection& db, Key object, const CollectionRow& to,
                const std::string& name) {
  CollectionMove move(db, to);
  for (ImageRow image : ImagesOfObject(access, db, object)) {
    image.record.updated_ms = NowMs();
    move.Move(image, FindOrInsertObject(db, to.key, name));
  }
}

// The smaller of the two moves into the larger; the object that is left has the name.
void Merge(Access& access, Connection& db, Key collection, Key one, Key other,
           const std::string& name) {
  const bool into_one = CountImagesOf(db, one) >= CountImagesOf(db, other);
  const Key kept = into_one ? one : other;
  const Key gone = into_one ? other : one;
  // The last image to go takes its object along, and with it the name.
  for (ImageRow image : ImagesOfObject(access, db, gone)) {
    image.record.updated_ms = NowMs();
    MoveImage(db, collection, image, kept);
  }
  RenameObject(db, kept, name);
}

// `check` of the object as it is.
void CheckObjectNow(Connection& db, Key collection, const ObjectRecord& now,
                    const ObjectCheck& check) {
  ImageListing first;
  first.which.object = now.object;
  first.limit = 1;
  check(now, SelectImagePage(db, collection, first).records.at(0).id);
}

bool SameRecord(const ImageRecord& a, const ImageRecord& b) {
  return a.collection == b.collection && a.object == b.object && a.metadata == b.metadata &&
         a.source == b.source;
}

void Change(Access& access, Connection& db, Key collection, ImageRow image,
            const ImageRecord& changed) {
  if (changed.metadata != image.record.metadata || changed.source != image.record.source) {
    db.Prepare("UPDATE images SET metadata = ?, source = ?, updated_ms = ? WHERE key = ?")
        .Bind(changed.metadata, changed.source, changed.updated_ms, image.key)
        .Run();
  }
  image.record = changed;
  const CollectionRow to = RequireCollection(db, changed.collection);
  const Key object = FindOrInsertObject(db, to.key, changed.object);
  if (to.key == collection && object == image.object) return;
  access.RequireSpace(StoredBytes(db, image));
  if (to.key == collection) {
    MoveImage(db, collection, image, object);
  } else {
    CollectionMove(db, to).Move(image, object);
  }
}

}  // namespace

std::vector<PutOutcome> Writer::PutAll(std::span<const ImagePut> puts) {
  std::uint64_t bytes = 0;
  for (const ImagePut& put : puts) bytes += put.request.bytes.size();
  access_.RequireSpace(bytes);
  if (const OriginalStore* store = originals_.originals().store()) {
    access_.RequireSpace(bytes, store->directory());
  }
  std::vector<std::unique_ptr<IncomingOriginal>> originals(puts.size());
  const auto receive = [&](std::size_t i) {  // nullptr: into the database, or nowhere
    if (!puts[i].keep_content) return;
    originals[i] = originals_.originals().Receive(puts[i].record.sha256, puts[i].request.bytes);
  };
  std::vector<PutOutcome> outcomes(puts.size());
  try {
    for (std::size_t i = 0; i < puts.size(); ++i) receive(i);
    access_.Write([&](Connection& db) {
      for (std::size_t i = 0; i < puts.size(); ++i) {
        outcomes[i] = Store(db, puts[i], originals[i].get());
      }
    });
  } catch (...) {
    for (std::size_t i = 0; i < puts.size(); ++i) {
      if (originals[i]) originals_.Forget(puts[i].record.sha256);
    }
    throw;
  }
  const bool replaced = std::any_of(outcomes.begin(), outcomes.end(), [](const PutOutcome& one) {
    return one.outcome == AddOutcome::kReplaced;
  });
  if (replaced) originals_.Tidy();
  return outcomes;
}

PutOutcome Writer::Store(Connection& db, const ImagePut& put, IncomingOriginal* original) const {
  const AddRequest& request = put.request;
  const CollectionRow collection = RequireCollection(db, request.collection);
  refusals::CheckIsMeant(request, collection.created_ms);
  // Somebody else may have stored the same while this image was described.
  if (const auto unchanged = FindUnchangedIn(db, collection.key, request, put.record.sha256)) {
    if (put.check) put.check(&*unchanged);
    return {AddOutcome::kUnchanged, *unchanged};
  }
  ImageRow image{0, 0, put.record};
  auto replaced = FindImage(db, collection.key, image.record.id);
  if (replaced && !request.id) {  // a generated id that was given to another image by name
    image.record.id = image.record.sha256;
    replaced = FindImage(db, collection.key, image.record.id);
  }
  if (put.check) put.check(replaced ? &replaced->record : nullptr);
  if (replaced) DeleteImage(db, *replaced);
  image.object = FindOrInsertObject(db, collection.key, request.object);
  if (!put.keep_times) image.record.added_ms = image.record.updated_ms = NowMs();
  const Key key = InsertImage(db, collection.key, image);
  db.Prepare("INSERT INTO features (image, model, data) VALUES (?, ?, ?)")
      .Bind(key, model_.key, put.encoded)
      .Run();
  if (put.keep_content) originals_.originals().Keep(db, key, request.bytes, original);
  if (collection.active_vocabulary != 0) {
    if (collection.active_vocabulary == put.vocabulary) {
      InsertImageWords(db, collection.active_vocabulary, key, put.words);
    } else {  // switched since
      const Quantizer quantizer(ReadVocabulary(db, collection.active_vocabulary));
      InsertImageWords(db, collection.active_vocabulary, key,
                       quantizer.Assign(put.features.descriptors, request.threads));
    }
  }
  return {replaced ? AddOutcome::kReplaced : AddOutcome::kCreated, image.record};
}

bool Writer::Remove(const std::string& collection, const std::string& id, const ImageCheck& check) {
  bool removed = false;
  access_.Write(
      [&](Connection& db) {
        const auto image = FindImage(db, RequireCollection(db, collection).key, id);
        removed = image.has_value();
        if (!image) return;
        if (check) check(&image->record);
        DeleteImage(db, *image);
      },
      {.reclaim = true});
  originals_.Tidy();
  return removed;
}

std::uint64_t Writer::RemoveObject(const std::string& collection, const std::string& object,
                                   const ObjectCheck& check) {
  std::uint64_t removed = 0;
  access_.Write(
      [&](Connection& db) {
        const Key in = RequireCollection(db, collection).key;
        const Key key = FindObject(db, in, object);
        if (check && key != 0) CheckObjectNow(db, in, {object, CountImagesOf(db, key)}, check);
        removed = static_cast<std::uint64_t>(
            db.Prepare("DELETE FROM images WHERE object = ?").Bind(key).Run());
        db.Prepare("DELETE FROM objects WHERE key = ?").Bind(key).Run();
      },
      {.reclaim = true});
  originals_.Tidy();
  return removed;
}

std::uint64_t Writer::SweepOriginals() { return originals_.Sweep(); }

void Writer::RestoreContent(const ImageRecord& stored, Bytes bytes) {
  originals_.Restore(stored, bytes);
}

MoveOriginalsResult Writer::MoveOriginals(const std::filesystem::path& directory,
                                          const std::function<void(double)>& progress) {
  return originals_.Move(directory, progress);
}

ImageRecord Writer::ChangeImage(const std::string& collection, const std::string& id,
                                const ImageChange& change) {
  access_.RequireSpace(change.metadata ? change.metadata->size() : 0);
  ImageRecord changed;
  access_.Write([&](Connection& db) {
    const ImageRow image = RequireImage(db, collection, id);
    if (change.check) change.check(image.record);
    changed = image.record;
    if (change.object) changed.object = *change.object;
    if (change.source) changed.source = *change.source;
    if (change.collection) changed.collection = RequireCollection(db, *change.collection).name;
    if (change.metadata) changed.metadata = MergeMetadata(changed.metadata, *change.metadata);
    if (!SameRecord(changed, image.record)) changed.updated_ms = NowMs();
    Change(access_, db, RequireCollection(db, collection).key, image, changed);
  });
  return changed;
}

ObjectRecord Writer::ChangeObject(const std::string& collection, const std::string& object,
                                  const ObjectChange& change) {
  access_.RequireSpace(0);
  ObjectRecord changed;
  const auto write = [&](Connection& db) {
    const Key in = RequireCollection(db, collection).key;
    const Key key = FindObject(db, in, object);
    if (key == 0) {
      throw Error(ErrorCode::kNotFound, "object_not_found",
                  "No image shows the object \"" + Shown(object) + "\".");
    }
    changed = {object, CountImagesOf(db, key)};
    if (change.check) CheckObjectNow(db, in, changed, change.check);
    const CollectionRow to = RequireCollection(db, change.collection.value_or(collection));
    const Key taken = FindObject(db, to.key, change.name);
    if (taken == key) return;
    changed.object = change.name;
    const std::uint64_t there = taken == 0 ? 0 : CountImagesOf(db, taken);
    if (there > 0 && !change.merge) {
      throw Error(ErrorCode::kConflict, "object_exists",
                  "The object \"" + Shown(change.name) + "\" already exists with " +
                      std::to_string(there) + (there == 1 ? " image" : " images") +
                      ". Use merge=true to merge the two.");
    }
    changed.images += there;
    if (to.key != in) {
      MoveObject(access_, db, key, to, change.name);
    } else if (taken == 0) {
      RenameObject(db, key, change.name);
    } else {
      Merge(access_, db, in, key, taken, change.name);
    }
  };
  if (change.merge || change.collection) {
    access_.Write(write, {.reclaim = true, .alone = true});  // as much may move as there is
  } else {
    access_.Write(write);
  }
  return changed;
}

}  // namespace pliant
