// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: images, with their collections and objects.
#include <memory>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "descriptor/base/stopwatch.h"
#include "index/engine/engine_core.h"
#include "index/files/names.h"
#include "index/files/text.h"
#include "index/store/blob_codec.h"
#include "index/store/refusals.h"

namespace pliant {
namespace {

constexpr std::size_t kGeneratedIdDigits = 32;

void CheckEnough(std::size_t keypoints) {
  if (keypoints >= kMinKeypoints) return;
  throw Error(ErrorCode::kUnprocessable, "too_few_features",
              "The image has " + std::to_string(keypoints) + " keypoints; at least " +
                  std::to_string(kMinKeypoints) +
                  " are needed. It is too plain, too small or too blurred to be recognised.");
}

Features Describe(EngineCore& core, const AddRequest& request, std::string* media_type,
                  ExtractionTimings* timings) {
  const FeatureExtractor& extract = request.as_query ? core.query_extractor() : core.extractor();
  const Stopwatch decoding;
  const DecodedImage decoded = extract.Decode(request.bytes);
  timings->decode_ms = decoding.ms();
  *media_type = MediaType(decoded.format);
  return extract.Extract(decoded, request.threads, timings);
}

// Everything about a new image that takes time. `given`: its features; null: to be described.
ImagePut Prepare(EngineCore& core, const AddRequest& request, const std::string& sha256,
                 const Features* given, AddTimings* timings) {
  ImagePut put{.request = request};
  ImageRecord& record = put.record;
  if (auto described = core.catalogue().FindDescribed(sha256)) {
    record = std::move(described->record);
    put.encoded = std::move(described->features);
    put.features = DecodeFeatures(put.encoded);
  } else {
    Features features = given != nullptr
                            ? *given
                            : Describe(core, request, &record.media_type, &timings->extraction);
    CheckEnough(features.keypoints.size());
    put.encoded = EncodeFeatures(features);
    record.width = features.width;
    record.height = features.height;
    record.keypoints = static_cast<std::uint32_t>(features.keypoints.size());
    put.features = InStoredPrecision(std::move(features));
  }
  record.collection = request.collection;
  record.id = request.id.value_or(sha256.substr(0, kGeneratedIdDigits));
  record.object = request.object;
  record.sha256 = sha256;
  record.metadata = request.metadata;
  record.source = request.source;
  record.bytes = request.bytes.size();
  const CollectionView view = core.View(request.collection);
  if (view.has_vocabulary()) {
    const Stopwatch quantizing;
    put.vocabulary = view.vocabulary;
    put.words = view.quantizer->Assign(put.features.descriptors, request.threads);
    timings->quantize_ms = quantizing.ms();
  }
  put.keep_content = core.keeps_originals() && !request.bytes.empty();
  return put;
}

}  // namespace

bool Engine::CreateCollection(const std::string& name) {
  CheckCollectionName(name);
  return core_->writer().CreateCollection(name);
}

std::vector<std::string> Engine::ListCollections() { return core_->catalogue().ListCollections(); }

std::string Engine::CollectionName(const std::string& name_or_alias) {
  return core_->catalogue().RequireCollection(name_or_alias).name;
}

std::vector<AliasRecord> Engine::ListAliases() { return core_->catalogue().ListAliases(); }

void Engine::ChangeAliases(const AliasChanges& changes) {
  for (const auto& [name, collection] : changes) {
    if (collection) CheckAliasName(name);  // one that cannot be is not there
  }
  core_->writer().ChangeAliases(changes);
}

CollectionRecord Engine::ChangeCollection(const std::string& name, const CollectionChange& change) {
  if (change.display_name) CheckDisplayName(*change.display_name);
  if (change.found_from &&
      !(*change.found_from >= kLeastFoundFrom && *change.found_from <= kMostFoundFrom)) {
    throw Error(ErrorCode::kInvalidArgument, "found_from_invalid",
                "found_from must be 0.5 to 0.99.");
  }
  return core_->writer().ChangeCollection(name, change);
}

CollectionRecord Engine::GetCollection(const std::string& name) {
  return core_->catalogue().DescribeCollection(name);
}

std::string Engine::GetSelfTest(const std::string& name) {
  return core_->catalogue().SelfTestOf(name);
}

bool Engine::RemoveCollection(const std::string& name) {
  if (name == kDefaultCollection) {
    throw Error(ErrorCode::kConflict, "collection_permanent",
                "The collection \"default\" cannot be deleted.");
  }
  return core_->writer().RemoveCollection(name);
}

AddResult Engine::Add(const AddRequest& request, const ImageCheck& check) {
  return BeginAdd(request, check)();
}

AddResult Engine::AddFeatures(const AddRequest& request, const Features& features) {
  core_->CheckFeatures(features);
  if (features.keypoints.size() > kMaxKeypoints) {
    throw Error(ErrorCode::kInvalidArgument, "features_invalid",
                "An image has at most " + std::to_string(kMaxKeypoints) + " keypoints, not " +
                    std::to_string(features.keypoints.size()) + ".");
  }
  return BeginAdd(request, {}, &features)();
}

std::function<AddResult()> Engine::BeginAdd(const AddRequest& original, const ImageCheck& check) {
  return BeginAdd(original, check, nullptr);
}

std::function<AddResult()> Engine::BeginAdd(const AddRequest& original, const ImageCheck& check,
                                            const Features* given) {
  struct Pending {
    AddRequest request;
    std::optional<ImagePut> put;
    AddResult result;
  };
  const auto pending = std::make_shared<Pending>();
  AddRequest& request = pending->request = original;
  if (request.id) CheckImageId(*request.id);
  CheckObject(request.object);
  request.source = ToDisplayText(request.source);  // a file's name is no choice: not refused
  CheckSource(request.source);
  request.metadata = CanonicalMetadata(request.metadata);
  if (check && request.id) {
    const auto now = core_->catalogue().FindImage(request.collection, *request.id);
    check(now ? &*now : nullptr);
  }
  const std::string sha256 = Sha256Hex(
      request.bytes.empty() && given != nullptr ? Bytes(EncodeFeatures(*given)) : request.bytes);
  if (auto unchanged = core_->catalogue().FindUnchanged(request, sha256)) {
    pending->result = {AddOutcome::kUnchanged, *std::move(unchanged), {}};
    return [&core = *core_, pending] {
      const Bytes bytes = pending->request.bytes;
      if (!bytes.empty()) core.writer().RestoreContent(pending->result.image, bytes);
      return pending->result;
    };
  }
  pending->put.emplace(Prepare(*core_, request, sha256, given, &pending->result.timings));
  pending->put->check = check;
  return [&core = *core_, pending] {
    const Stopwatch writing;
    PutOutcome stored = core.writer().Put(*pending->put);
    pending->result.timings.database_ms = writing.ms();
    pending->result.outcome = stored.outcome;
    pending->result.image = std::move(stored.image);
    return pending->result;
  };
}

std::optional<ImageRecord> Engine::FindBySha256(const std::string& collection,
                                                const std::string& sha256) {
  return core_->catalogue().FindBySha256(collection, sha256);
}

ImageRecord Engine::Get(const std::string& collection, const std::string& id) {
  auto found = core_->catalogue().FindImage(collection, id);
  if (!found) throw refusals::NoImage(collection, id);
  return *std::move(found);
}

Features Engine::GetFeatures(const std::string& collection, const std::string& id) {
  const Key key = core_->catalogue().RequireCollection(collection).key;
  return core_->GetFeatures({key, id}, collection);
}

std::vector<std::uint8_t> Engine::GetContent(const std::string& collection, const std::string& id) {
  return core_->catalogue().ReadContent(collection, id);
}

bool Engine::Remove(const std::string& collection, const std::string& id, const ImageCheck& check) {
  return core_->writer().Remove(collection, id, check);
}

ImagePage Engine::ListPage(const ImageListing& list) {
  CheckListing(list.which, list);
  return core_->catalogue().ListImagePage(list);
}

void Engine::ForEachPage(const ImageListing& list,
                         const std::function<void(const ImagePage&)>& work) {
  CheckListing(list.which, list);
  core_->catalogue().ForEachImagePage(list, work);
}

void Engine::ForEachFeatures(const ImageListing& list,
                             const std::function<void(const ImagePage&)>& look,
                             const std::function<void(const ImageRecord&, const Features&)>& take) {
  CheckListing(list.which, list);
  core_->catalogue().ForEachImageFeatures(list, look,
                                          [&](const ImageRecord& record, Bytes encoded) {
                                            Features features = DecodeFeatures(encoded);
                                            features.model_id = core_->model().model_id;
                                            take(record, features);
                                          });
}

DescriptorInfo Engine::Model() { return core_->model(); }

ObjectPage Engine::ListPage(const ObjectListing& list) {
  CheckListing(list.which, list);
  return core_->catalogue().ListObjectPage(list);
}

std::uint64_t Engine::RemoveWhere(const Selection& which) {
  CheckSelection(which);
  if (which.all()) {
    throw Error(ErrorCode::kInvalidArgument, "selection_empty",
                "Specify which images to remove. RemoveCollection removes a whole collection.");
  }
  return core_->writer().RemoveWhere(which);
}

ImageRecord Engine::Change(const std::string& collection, const std::string& id,
                           const ImageChange& change) {
  if (change.object) CheckObject(*change.object);
  if (change.source) CheckSource(*change.source);
  return core_->writer().ChangeImage(collection, id, change);
}

std::optional<ObjectRecord> Engine::GetObject(const std::string& collection,
                                              const std::string& object) {
  return core_->catalogue().FindObject(collection, object);
}

std::uint64_t Engine::RemoveObject(const std::string& collection, const std::string& object,
                                   const ObjectCheck& check) {
  return core_->writer().RemoveObject(collection, object, check);
}

ObjectRecord Engine::ChangeObject(const std::string& collection, const std::string& object,
                                  const ObjectChange& change) {
  CheckObject(change.name);
  if (change.name.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "object_invalid", "object must not be empty.");
  }
  return core_->writer().ChangeObject(collection, object, change);
}

}  // namespace pliant
