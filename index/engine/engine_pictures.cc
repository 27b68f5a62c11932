// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: adding, reading and removing pictures.
#include <chrono>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "index/engine/engine_impl.h"
#include "index/files/text.h"
#include "index/store/blob_codec.h"
#include "index/store/sqlite/catalogue_vocabularies.h"
#include "index/store/sqlite/database.h"

namespace pliant {

// Everything about a new picture that takes time, worked out before the writer's turn.
struct Engine::Impl::Prepared {
  ImageRecord record;
  std::vector<std::uint8_t> features_blob;
  std::unique_ptr<IncomingOriginal> original;  // nullptr: it goes into the database, or nowhere
  Features features;                           // in stored precision
  Key vocabulary = 0;                          // that made `bow`
  Bow bow;
  AddTimings timings;
};

namespace {

class Stopwatch {
 public:
  double Ms() const {
    return std::chrono::duration<double, std::milli>(Clock::now() - start_).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

constexpr std::size_t kGeneratedIdDigits = 32;

bool IsSame(const ImageRecord& stored, const AddRequest& request) {
  return stored.object == request.object && stored.metadata == request.metadata;
}

bool OtherObject(const ImageRecord& stored, const AddRequest& request) {
  return !request.object.empty() && request.object != stored.object;
}

bool OtherMetadata(const ImageRecord& stored, const AddRequest& request) {
  return request.metadata != "{}" && request.metadata != stored.metadata;
}

// Without an id the bytes say which picture is meant. It must not get another object or other
// metadata in silence, nor keep its own in silence; what is left out is not asked for.
[[noreturn]] void ThrowSameBytes(const ImageRecord& stored, const AddRequest& request) {
  const bool other_object = OtherObject(stored, request);
  const std::string difference = other_object
                                     ? "of object \"" + ToDisplayText(stored.object) +
                                           "\", not of \"" + ToDisplayText(request.object) + "\""
                                     : "with other metadata";
  throw Error(ErrorCode::kConflict, "same_bytes",
              "the same bytes are stored as picture \"" + ToDisplayText(stored.id) + "\" " +
                  difference + "; give that id to change it, or another to store them twice");
}

void CheckEnough(std::size_t keypoints) {
  if (keypoints >= kMinKeypoints) return;
  throw Error(ErrorCode::kUnprocessable, "too_few_features",
              "the picture has " + std::to_string(keypoints) + " key points, " +
                  std::to_string(kMinKeypoints) +
                  " are the least: it is too plain, too small or too blurred to be recognised");
}

}  // namespace

PictureRow Engine::Impl::RequirePicture(Connection& db, const std::string& collection,
                                        const std::string& id) {
  auto picture = FindPicture(db, RequireCollection(db, collection).key, id);
  if (!picture) {
    throw Error(
        ErrorCode::kNotFound, "image_not_found",
        "there is no image \"" + ToDisplayText(id) + "\" in collection \"" + collection + "\"");
  }
  return *std::move(picture);
}

AddResult Engine::Impl::Add(const AddRequest& original) {
  AddRequest request = original;
  if (request.id) CheckImageId(*request.id);
  CheckObject(request.object);
  CheckSource(request.source);
  request.metadata = CanonicalMetadata(request.metadata);
  const std::string sha256 = Sha256Hex(request.bytes);
  const auto unchanged = Read([&](Connection& db) {
    return FindUnchanged(db, RequireCollection(db, request.collection), request, sha256);
  });
  if (unchanged) {
    RestoreOriginal(*unchanged, request.bytes);
    return {AddOutcome::kUnchanged, *unchanged, {}};
  }
  const Prepared prepared = Prepare(request, sha256);
  AddResult result;
  const Stopwatch writing;
  try {
    Write([&](Connection& db) { result = Store(db, request, prepared); });
  } catch (...) {
    if (prepared.original) ForgetOriginal(sha256);
    throw;
  }
  if (result.outcome == AddOutcome::kReplaced) TidyOriginals();
  result.timings = prepared.timings;
  result.timings.database_ms = writing.Ms();
  return result;
}

std::optional<ImageRecord> Engine::Impl::FindUnchanged(Connection& db,
                                                       const CollectionRow& collection,
                                                       const AddRequest& request,
                                                       const std::string& sha256) {
  if (!request.id) {
    const std::vector<ImageRecord> found = PicturesBySha256(db, collection.key, sha256);
    for (const ImageRecord& stored : found) {
      if (!OtherObject(stored, request) && !OtherMetadata(stored, request)) return stored;
    }
    if (!found.empty()) ThrowSameBytes(found.front(), request);
    return std::nullopt;
  }
  const auto found = FindPicture(db, collection.key, *request.id);
  if (!found || found->record.sha256 != sha256 || !IsSame(found->record, request))
    return std::nullopt;
  return found->record;
}

Engine::Impl::Prepared Engine::Impl::Prepare(const AddRequest& request, const std::string& sha256) {
  Prepared prepared;
  const auto reused = Read([&](Connection& db) -> std::optional<ImageRecord> {
    const Key key = FindFeaturesOf(db, sha256, model_.key);
    if (key == 0) return std::nullopt;
    prepared.features_blob = ReadFeaturesBlob(db, key);
    return FindPictureByKey(db, key)->record;
  });
  ImageRecord& record = prepared.record;
  if (reused) {
    record = *reused;
  } else {
    const FeatureExtractor& extract = extractor();
    const Stopwatch decoding;
    const DecodedImage decoded = DecodeImage(request.bytes, extract.options().decode);
    prepared.timings.extraction.decode_ms = decoding.Ms();
    const Features features =
        extract.Extract(decoded, request.threads, &prepared.timings.extraction);
    CheckEnough(features.keypoints.size());
    prepared.features_blob = EncodeFeatures(features);
    record.media_type = MediaType(decoded.format);
    record.width = features.width;
    record.height = features.height;
    record.keypoints = static_cast<std::uint32_t>(features.keypoints.size());
  }
  prepared.features = DecodeFeatures(prepared.features_blob);
  record.collection = request.collection;
  record.id = request.id.value_or(sha256.substr(0, kGeneratedIdDigits));
  record.object = request.object;
  record.sha256 = sha256;
  record.metadata = request.metadata;
  record.source = request.source;
  record.bytes = request.bytes.size();
  const CollectionView view = CurrentView(request.collection);
  if (view.quantizer) {
    const Stopwatch quantizing;
    prepared.vocabulary = view.vocabulary;
    const Descriptors& descriptors = prepared.features.descriptors;
    prepared.bow =
        view.quantizer->BowOf(descriptors, 0, view.quantizer->Assign(descriptors, request.threads));
    prepared.timings.quantize_ms = quantizing.Ms();
  }
  if (options_.keep_originals) prepared.original = originals_.Receive(sha256, request.bytes);
  return prepared;
}

AddResult Engine::Impl::Store(Connection& db, const AddRequest& request, const Prepared& prepared) {
  const CollectionRow collection = RequireCollection(db, request.collection);
  // Somebody else may have stored the same while this picture was described.
  if (const auto unchanged = FindUnchanged(db, collection, request, prepared.record.sha256)) {
    return {AddOutcome::kUnchanged, *unchanged, {}};
  }
  PictureRow picture{0, 0, prepared.record};
  auto replaced = FindPicture(db, collection.key, picture.record.id);
  if (replaced && !request.id) {  // a generated id that was given to another picture by name
    picture.record.id = picture.record.sha256;
    replaced = FindPicture(db, collection.key, picture.record.id);
  }
  if (replaced) DeletePicture(db, *replaced);
  picture.object = FindOrInsertObject(db, collection.key, request.object);
  picture.record.added_ms = NowMs();
  const Key key = InsertPicture(db, collection.key, picture);
  InsertFeatures(db, key, model_.key, prepared.features_blob);
  if (options_.keep_originals) originals_.Keep(db, key, request.bytes, prepared.original.get());
  if (collection.active_vocabulary != 0) {
    if (collection.active_vocabulary == prepared.vocabulary) {
      InsertPictureWords(db, collection.active_vocabulary, key, prepared.bow);
    } else {  // switched since
      const Quantizer quantizer(ReadVocabulary(db, collection.active_vocabulary));
      const Descriptors& descriptors = prepared.features.descriptors;
      InsertPictureWords(
          db, collection.active_vocabulary, key,
          quantizer.BowOf(descriptors, 0, quantizer.Assign(descriptors, request.threads)));
    }
  }
  return {replaced ? AddOutcome::kReplaced : AddOutcome::kCreated, picture.record, {}};
}

Features Engine::Impl::GetFeatures(const std::string& collection, const std::string& id) {
  Features features = Read([&](Connection& db) {
    return DecodeFeatures(ReadFeaturesBlob(db, RequirePicture(db, collection, id).key));
  });
  features.model_id = model_.info.model_id;
  return features;
}

std::vector<ImageRecord> Engine::Impl::List(const ListOptions& options) {
  return Read([&](Connection& db) {
    return SelectPictures(db, RequireCollection(db, options.collection).key, options);
  });
}

bool Engine::Impl::Remove(const std::string& collection, const std::string& id) {
  bool removed = false;
  Write(
      [&](Connection& db) {
        const auto picture = FindPicture(db, RequireCollection(db, collection).key, id);
        removed = picture.has_value();
        if (picture) DeletePicture(db, *picture);
      },
      true);
  TidyOriginals();
  return removed;
}

std::uint64_t Engine::Impl::RemoveObject(const std::string& collection, const std::string& object) {
  std::uint64_t removed = 0;
  Write(
      [&](Connection& db) {
        const Key key = FindObject(db, RequireCollection(db, collection).key, object);
        db.Prepare("DELETE FROM pictures WHERE object = ?").Bind(key).Run();
        removed = static_cast<std::uint64_t>(db.changes());
        db.Prepare("DELETE FROM objects WHERE key = ?").Bind(key).Run();
      },
      true);
  TidyOriginals();
  return removed;
}

bool Engine::Impl::CreateCollection(const std::string& name) {
  CheckCollectionName(name);
  bool created = false;
  Write([&](Connection& db) {
    created = !FindCollection(db, name).has_value();
    if (created) InsertCollection(db, name, model_.key);
  });
  return created;
}

bool Engine::Impl::RemoveCollection(const std::string& name) {
  if (name == kDefaultCollection) {
    throw Error(ErrorCode::kConflict, "collection_permanent",
                "the collection \"default\" cannot be removed");
  }
  bool removed = false;
  Write(
      [&](Connection& db) {
        const auto collection = FindCollection(db, name);
        removed = collection.has_value();
        if (collection) {
          db.Prepare("DELETE FROM collections WHERE key = ?").Bind(collection->key).Run();
        }
      },
      true);
  TidyOriginals();
  return removed;
}

}  // namespace pliant
