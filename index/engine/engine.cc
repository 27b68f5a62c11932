// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/engine.h"

#include <algorithm>
#include <limits>

#include "descriptor/base/error.h"
#include "index/engine/engine_impl.h"
#include "index/rank/memory_ranker.h"
#include "index/store/open_store.h"

namespace pliant {
namespace {

std::shared_ptr<const Descriptor> MakeDescriptorFor(const EngineOptions& options,
                                                    const std::string& database_descriptor) {
  if (options.custom_descriptor) return options.custom_descriptor;
  return MakeDescriptor(options.descriptor.empty() ? database_descriptor : options.descriptor,
                        options.descriptor_options);
}

void CheckPage(int limit) {
  if (limit < 1 || limit > 1000) {
    throw Error(ErrorCode::kInvalidArgument, "limit_invalid",
                "limit must be 1 to 1000, not " + std::to_string(limit));
  }
}

// ExtractionOptions::enlarge_below. An indexed image is kept in memory, so it is enlarged only
// where it has few keypoints. A query always: its object may be a small part of it.
constexpr int kEnlargeIndexedBelow = 512;
constexpr int kEnlargeQueryBelow = std::numeric_limits<int>::max();

}  // namespace

Engine::Impl::Impl(EngineOptions options) : options_(std::move(options)) {
  StoreOptions opening;
  opening.database = options_.database;
  opening.create = options_.create;
  opening.read_only = options_.read_only;
  opening.busy_timeout_ms = options_.busy_timeout_ms;
  opening.reserve_bytes = options_.reserve_bytes;
  opening.model_of_new = [this] {
    options_.custom_descriptor = MakeDescriptorFor(options_, "deal");
    return options_.custom_descriptor->info();
  };
  store_ = OpenStore(opening);
  const bool describes = options_.load_descriptor && !options_.read_only;
  const ExtractionLimits& limits = store_->model().limits;
  FollowLimits(limits, options_.extraction);
  limits_settled_ = limits.max_keypoints != 0 && limits.max_side_px != 0;
  if (describes) SettleLimits(options_.extraction);
  store_->OpenOriginals(options_.originals_dir, describes);
  if (options_.custom_descriptor) {  // another process may have made the database meanwhile
    CheckModel(options_.custom_descriptor->info());
  }
  if (options_.load_descriptor) extractor();
  ranker_ = std::make_unique<MemoryRanker>(store_->OpenFeed(), options_.loading);
  if (options_.load_index) ranker_->Load();
  if (!options_.read_only) store_->BeginWriting([this] { Follow(); });
  follower_ = store_->FollowOthers([this] {
    try {
      Follow();
    } catch (const Error&) {
      // The next search tries again, and says what is wrong.
    }
  });
}

void Engine::Impl::Follow() {
  try {
    ranker_->Follow();
  } catch (const std::exception& error) {
    if (options_.warn) {
      options_.warn(std::string("the index cannot follow what was written: ") + error.what());
    }
    throw;
  }
}

void Engine::Impl::CheckModel(const DescriptorInfo& info) const {
  const std::string& model_id = store_->model().info.model_id;
  if (info.model_id == model_id) return;
  throw Error(ErrorCode::kConflict, "model_mismatch",
              "the database " + options_.database.string() + " was made with " + model_id +
                  ", but the descriptor is " + info.model_id +
                  "; use that one, or index into a new database");
}

void Engine::Impl::FollowLimits(const ExtractionLimits& stored,
                                ExtractionOptions& extraction) const {
  const auto follow = [&](const char* name, int limit, const std::optional<int>& wanted,
                          int& value) {
    if (wanted && limit != 0 && *wanted != limit) {
      throw Error(ErrorCode::kConflict, "extraction_mismatch",
                  "the database " + options_.database.string() + " was made with " + name + " " +
                      std::to_string(limit) + ", not " + std::to_string(*wanted) +
                      "; leave it out to follow, or index into a new database");
    }
    value = limit != 0 ? limit : wanted.value_or(value);
  };
  follow("max_keypoints", stored.max_keypoints, options_.max_keypoints,
         extraction.keypoints.max_keypoints);
  follow("max_side_px", stored.max_side_px, options_.max_side_px, extraction.decode.max_side_px);
}

// Before the first image is described. With no limit to the side there is nothing to write down
// for it: 0 means "not decided".
void Engine::Impl::SettleLimits(ExtractionOptions& extraction) {
  if (limits_settled_ || options_.read_only) return;
  FollowLimits(
      store_->SettleExtraction({extraction.keypoints.max_keypoints, extraction.decode.max_side_px}),
      extraction);
  limits_settled_ = true;
}

const Engine::Impl::Extractors& Engine::Impl::extractors() {
  const std::lock_guard lock(extractors_mutex_);
  if (!extractors_) {
    std::shared_ptr<const Descriptor> descriptor =
        MakeDescriptorFor(options_, store_->model().info.name);
    CheckModel(descriptor->info());
    ExtractionOptions extraction = options_.extraction;  // others read that
    SettleLimits(extraction);
    const FeatureExtractor plain(std::move(descriptor), extraction);
    const auto enlarging = [&](int below) {
      return options_.enlarge ? plain.WithEnlargeBelow(below) : plain;
    };
    extractors_ = std::make_unique<const Extractors>(
        Extractors{enlarging(kEnlargeIndexedBelow), enlarging(kEnlargeQueryBelow)});
  }
  return *extractors_;
}

EngineStats Engine::Impl::Stats() {
  EngineStats stats = catalogue().Count();
  stats.index_bytes = ranker_->memory_bytes();
  if (stats.server) {
    stats.server->behind = std::max<std::int64_t>(0, stats.server->commit - ranker_->followed());
  }
  return stats;
}

std::vector<std::string> Engine::Impl::Check() {
  const std::vector<std::string> problems = catalogue().Check();
  if (!problems.empty()) return problems;  // the index cannot be better than what it is made from
  return ranker_->Check();
}

Engine::Engine(EngineOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Engine::~Engine() = default;

AddResult Engine::Add(const AddRequest& request, const ImageCheck& check) {
  return impl_->BeginAdd(request, check)();
}

std::function<AddResult()> Engine::BeginAdd(const AddRequest& request, const ImageCheck& check) {
  return impl_->BeginAdd(request, check);
}

std::optional<ImageRecord> Engine::FindBySha256(const std::string& collection,
                                                const std::string& sha256) {
  return impl_->catalogue().FindBySha256(collection, sha256);
}

ImageRecord Engine::Get(const std::string& collection, const std::string& id) {
  return impl_->Get(collection, id);
}

Features Engine::GetFeatures(const std::string& collection, const std::string& id) {
  return impl_->GetFeatures(collection, id);
}

std::vector<std::uint8_t> Engine::GetContent(const std::string& collection, const std::string& id) {
  return impl_->catalogue().ReadContent(collection, id);
}

std::vector<ImageRecord> Engine::List(const ListOptions& options) {
  CheckPage(options.limit);
  return impl_->catalogue().ListImages(options);
}

bool Engine::Remove(const std::string& collection, const std::string& id, const ImageCheck& check) {
  return impl_->writer().Remove(collection, id, check);
}

ImagePage Engine::ListPage(const ImageListing& list) {
  CheckListing(list.which, list);
  return impl_->catalogue().ListImagePage(list);
}

void Engine::ForEachPage(const ImageListing& list,
                         const std::function<void(const ImagePage&)>& work) {
  CheckListing(list.which, list);
  impl_->catalogue().ForEachImagePage(list, work);
}

void Engine::ForEachFeatures(const ImageListing& list,
                             const std::function<void(const ImagePage&)>& look,
                             const std::function<void(const ImageRecord&, const Features&)>& take) {
  CheckListing(list.which, list);
  impl_->ForEachFeatures(list, look, take);
}

DescriptorInfo Engine::Model() { return impl_->Model(); }

ObjectPage Engine::ListPage(const ObjectListing& list) {
  CheckListing(list.which, list);
  return impl_->catalogue().ListObjectPage(list);
}

std::uint64_t Engine::RemoveWhere(const Selection& which) {
  CheckSelection(which);
  if (which.all()) {
    throw Error(ErrorCode::kInvalidArgument, "selection_empty",
                "which images to remove must be said; the whole collection is RemoveCollection");
  }
  return impl_->writer().RemoveWhere(which);
}

std::vector<ObjectRecord> Engine::ListObjects(const std::string& collection,
                                              const std::string& after, int limit) {
  CheckPage(limit);
  return impl_->catalogue().ListObjects(collection, after, limit);
}

std::optional<ObjectRecord> Engine::GetObject(const std::string& collection,
                                              const std::string& object) {
  return impl_->catalogue().FindObject(collection, object);
}

std::uint64_t Engine::RemoveObject(const std::string& collection, const std::string& object,
                                   const ObjectCheck& check) {
  return impl_->writer().RemoveObject(collection, object, check);
}

ImageRecord Engine::Change(const std::string& collection, const std::string& id,
                           const ImageChange& change) {
  return impl_->Change(collection, id, change);
}

ObjectRecord Engine::ChangeObject(const std::string& collection, const std::string& object,
                                  const ObjectChange& change) {
  return impl_->ChangeObject(collection, object, change);
}

SearchResult Engine::Search(Bytes encoded, const SearchOptions& options) {
  return impl_->Search(encoded, options);
}

ObjectLocation Engine::Locate(Bytes encoded, const std::string& collection,
                              const std::string& object, int threads) {
  return impl_->Locate(encoded, collection, object, threads);
}

SearchResult Engine::SearchStored(const std::string& image_id, const SearchOptions& options) {
  return impl_->SearchStored(image_id, options);
}

SearchResult Engine::SearchFeatures(const Features& features, const SearchOptions& options,
                                    const SecondPass& second) {
  return impl_->SearchFeatures(features, options, second);
}

std::optional<Features> Engine::DescribeFiner(Bytes encoded, const Features& known, int threads) {
  return impl_->DescribeFiner(encoded, known, threads);
}

SearchResult Engine::SearchExamples(const std::vector<std::string>& image_ids,
                                    const SearchOptions& options) {
  return impl_->SearchExamples(image_ids, options);
}

Comparison Engine::Compare(Bytes first, Bytes second, int threads) {
  return impl_->Compare(first, second, threads);
}

VocabularyRecord Engine::TrainVocabulary(const TrainOptions& options) {
  return impl_->TrainVocabulary(options);
}

std::vector<VocabularyRecord> Engine::ListVocabularies(const std::string& collection) {
  return impl_->catalogue().ListVocabularies(collection);
}

void Engine::UseVocabulary(const std::string& collection, std::int64_t id,
                           const UseOptions& options) {
  impl_->UseVocabulary(collection, id, options);
}

std::uint64_t Engine::CountUnquantized(const std::string& collection, std::int64_t id) {
  return impl_->catalogue().CountUnquantized(collection, id);
}

EngineStats Engine::Stats() { return impl_->Stats(); }

std::vector<std::string> Engine::Check() { return impl_->Check(); }

std::uint64_t Engine::SweepOriginals() { return impl_->writer().SweepOriginals(); }

MoveOriginalsResult Engine::MoveOriginals(const std::filesystem::path& directory,
                                          const std::function<void(double)>& progress) {
  return impl_->writer().MoveOriginals(directory, progress);
}

std::optional<OriginalsRecord> Engine::DescribeOriginals() {
  return impl_->catalogue().DescribeOriginals();
}

void Engine::Backup(const std::filesystem::path& target, const std::stop_token& stop) {
  impl_->catalogue().Backup(target, stop);
}

}  // namespace pliant
