// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: adding and reading images.
#include <memory>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/sha256.h"
#include "descriptor/base/stopwatch.h"
#include "index/engine/engine.h"
#include "index/engine/engine_impl.h"
#include "index/files/names.h"
#include "index/files/text.h"
#include "index/store/feature_codec.h"
#include "index/store/refusals.h"

namespace pliant {
namespace {

constexpr std::size_t kGeneratedIdDigits = 32;

void CheckEnough(std::size_t keypoints) {
  if (keypoints >= kMinKeypoints) return;
  throw Error(ErrorCode::kUnprocessable, "too_few_features",
              "the image has " + std::to_string(keypoints) + " keypoints, " +
                  std::to_string(kMinKeypoints) +
                  " are the least: it is too plain, too small or too blurred to be recognised");
}

}  // namespace

std::function<AddResult()> Engine::Impl::BeginAdd(const AddRequest& original,
                                                  const ImageCheck& check) {
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
    const auto now = catalogue().FindImage(request.collection, *request.id);
    check(now ? &*now : nullptr);
  }
  const std::string sha256 = Sha256Hex(request.bytes);
  if (auto unchanged = catalogue().FindUnchanged(request, sha256)) {
    pending->result = {AddOutcome::kUnchanged, *std::move(unchanged), {}};
    return [this, pending] {
      writer().RestoreContent(pending->result.image, pending->request.bytes);
      return pending->result;
    };
  }
  pending->put.emplace(Prepare(request, sha256, &pending->result.timings));
  pending->put->check = check;
  return [this, pending] {
    const Stopwatch writing;
    PutOutcome stored = writer().Put(*pending->put);
    pending->result.timings.database_ms = writing.ms();
    pending->result.outcome = stored.outcome;
    pending->result.image = std::move(stored.image);
    return pending->result;
  };
}

ImagePut Engine::Impl::Prepare(const AddRequest& request, const std::string& sha256,
                               AddTimings* timings) {
  ImagePut put{.request = request};
  ImageRecord& record = put.record;
  if (auto described = catalogue().FindDescribed(sha256)) {
    record = std::move(described->record);
    put.encoded = std::move(described->features);
    put.features = DecodeFeatures(put.encoded);
  } else {
    const FeatureExtractor& extract = request.as_query ? query_extractor() : extractor();
    const Stopwatch decoding;
    const DecodedImage decoded = extract.Decode(request.bytes);
    timings->extraction.decode_ms = decoding.ms();
    Features features = extract.Extract(decoded, request.threads, &timings->extraction);
    CheckEnough(features.keypoints.size());
    put.encoded = EncodeFeatures(features);
    record.media_type = MediaType(decoded.format);
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
  const CollectionView view = View(request.collection);
  if (view.has_vocabulary()) {
    const Stopwatch quantizing;
    put.vocabulary = view.vocabulary;
    const Descriptors& descriptors = put.features.descriptors;
    put.bow =
        view.quantizer->BowOf(descriptors, 0, view.quantizer->Assign(descriptors, request.threads));
    timings->quantize_ms = quantizing.ms();
  }
  put.keep_content = options_.keep_originals;
  return put;
}

ImageRecord Engine::Impl::Get(const std::string& collection, const std::string& id) {
  auto found = catalogue().FindImage(collection, id);
  if (!found) throw refusals::NoImage(collection, id);
  return *std::move(found);
}

ImageRecord Engine::Impl::Change(const std::string& collection, const std::string& id,
                                 const ImageChange& change) {
  if (change.object) CheckObject(*change.object);
  if (change.source) CheckSource(*change.source);
  return writer().ChangeImage(collection, id, change);
}

ObjectRecord Engine::Impl::ChangeObject(const std::string& collection, const std::string& object,
                                        const ObjectChange& change) {
  CheckObject(change.name);
  if (change.name.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "object_invalid", "an object needs a name");
  }
  return writer().ChangeObject(collection, object, change);
}

Features Engine::Impl::GetFeatures(const ImageRef& ref, const std::string& collection) {
  const auto found = catalogue().LoadImages({&ref, 1}, Load::kRecordsAndFeatures).front();
  if (!found) throw refusals::NoImage(collection, ref.id);
  Features features = DecodeFeatures(found->features);
  features.model_id = store_->model().info.model_id;
  return features;
}

void Engine::Impl::ForEachFeatures(
    const ImageListing& list, const std::function<void(const ImagePage&)>& look,
    const std::function<void(const ImageRecord&, const Features&)>& take) {
  catalogue().ForEachImageFeatures(list, look, [&](const ImageRecord& record, Bytes encoded) {
    Features features = DecodeFeatures(encoded);
    features.model_id = store_->model().info.model_id;
    take(record, features);
  });
}

bool Engine::Impl::CreateCollection(const std::string& name) {
  CheckCollectionName(name);
  return writer().CreateCollection(name);
}

void Engine::Impl::ChangeAliases(const AliasChanges& changes) {
  for (const auto& [name, collection] : changes) {
    if (collection) CheckAliasName(name);  // one that cannot be is not there
  }
  writer().ChangeAliases(changes);
}

bool Engine::Impl::RemoveCollection(const std::string& name) {
  if (name == kDefaultCollection) {
    throw Error(ErrorCode::kConflict, "collection_permanent",
                "the collection \"default\" cannot be removed");
  }
  return writer().RemoveCollection(name);
}

bool Engine::CreateCollection(const std::string& name) { return impl_->CreateCollection(name); }

std::vector<std::string> Engine::ListCollections() { return impl_->catalogue().ListCollections(); }

std::vector<CollectionLabel> Engine::ListLabels() { return impl_->catalogue().ListLabels(); }

std::string Engine::CollectionName(const std::string& name_or_alias) {
  return impl_->catalogue().RequireCollection(name_or_alias).name;
}

std::vector<AliasRecord> Engine::ListAliases() { return impl_->catalogue().ListAliases(); }

void Engine::ChangeAliases(const AliasChanges& changes) { impl_->ChangeAliases(changes); }

CollectionRecord Engine::ChangeCollection(const std::string& name, const CollectionChange& change) {
  if (change.display_name) CheckDisplayName(*change.display_name);
  return impl_->writer().ChangeCollection(name, change);
}

bool Engine::HasVocabulary(const std::string& collection) {
  return impl_->catalogue().RequireCollection(collection).vocabulary != 0;
}

CollectionRecord Engine::GetCollection(const std::string& name) {
  return impl_->catalogue().DescribeCollection(name);
}

bool Engine::RemoveCollection(const std::string& name) { return impl_->RemoveCollection(name); }

}  // namespace pliant
