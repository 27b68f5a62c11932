// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/engine.h"

#include <algorithm>

#include "descriptor/base/error.h"
#include "descriptor/features/foreign_features.h"
#include "index/engine/engine_core.h"
#include "index/engine/query_extraction.h"
#include "index/store/blob_codec.h"
#include "index/store/database_url.h"
#include "index/store/open_store.h"
#include "index/store/refusals.h"

namespace pliant {
namespace {

std::shared_ptr<const Descriptor> MakeDescriptorFor(const EngineOptions& options,
                                                    const DescriptorInfo& of_database) {
  if (options.custom_descriptor) return options.custom_descriptor;
  const std::vector<std::string> known = DescriptorNames();
  if (options.descriptor.empty() && std::ranges::find(known, of_database.name) == known.end()) {
    return MakeForeignDescriptor(of_database);
  }
  return MakeDescriptor(options.descriptor.empty() ? of_database.name : options.descriptor,
                        options.descriptor_options);
}

// Where the index is saved; empty: nowhere.
std::filesystem::path IndexFolder(const EngineOptions& options) {
  if (!IsDatabaseUrl(options.database.string())) {
    std::filesystem::path folder = std::filesystem::weakly_canonical(options.database);
    return folder += ".index";
  }
  if (options.index_dir.empty()) return {};
  const auto& [part, parts] = options.share;
  return std::filesystem::weakly_canonical(options.index_dir) /
         ("part-" + std::to_string(part) + "-of-" + std::to_string(parts));
}

// Of a query's preview and colours: a print of a quarter of the photo's width has as many as a
// stored one.
constexpr int kQueryPreviewSide = 4 * 128;
constexpr int kQueryColourSide = 4 * kColourGridSide;

}  // namespace

EngineCore::EngineCore(EngineOptions options) : options_(std::move(options)) {
  StoreOptions opening;
  opening.database = options_.database;
  opening.create = options_.create;
  opening.read_only = options_.read_only;
  opening.busy_timeout_ms = options_.busy_timeout_ms;
  opening.reserve_bytes = options_.reserve_bytes;
  opening.model_of_new = [this] {
    options_.custom_descriptor = MakeDescriptorFor(options_, {kDefaultDescriptor, {}, 0, {}});
    return options_.custom_descriptor->info();
  };
  store_ = OpenStore(opening);
  if (options_.part_servers) database_ = store_->Identity();
  const bool describes = options_.load_descriptor && !options_.read_only;
  const ExtractionLimits& limits = store_->model().limits;
  FollowLimits(limits, options_.extraction);
  limits_stored_ = limits.max_keypoints != 0 && limits.max_side_px != 0;
  if (describes) StoreLimits(options_.extraction);
  store_->OpenOriginals(options_.originals_dir, describes);
  if (options_.custom_descriptor) {  // another process may have made the database meanwhile
    CheckModel(options_.custom_descriptor->info());
  }
  if (options_.load_descriptor) extractor();
  MemoryRankerOptions ranking;
  ranking.loading = options_.loading;
  ranking.warn = options_.warn;
  ranking.save_from = options_.save_index_from;
  ranking.keep_previous = options_.part_servers != nullptr;
  if (const std::filesystem::path folder = IndexFolder(options_); !folder.empty()) {
    ranking.files = std::make_shared<IndexFiles>(folder, options_.reserve_bytes);
  }
  ranker_ = std::make_unique<MemoryRanker>(store_->OpenFeed(options_.share), std::move(ranking));
  if (options_.load_index) ranker_->Load();
  if (!options_.read_only) {
    store_->BeginWriting([this] { Follow(); });
    ranker_->BeginSaving();
  }
  follower_ = store_->FollowOthers([this] {
    try {
      Follow();
    } catch (const Error&) {
      // The next search tries again, and says what is wrong.
    }
  });
}

EngineCore::~EngineCore() { ranker_->Save(); }

Ranking EngineCore::Rank(const CollectionView& view, const RankQuery& query,
                         const RankOptions& options) {
  Ranking ranking = options_.part_servers
                        ? RankParts(view, query, options)
                        : pliant::Rank(*view.snapshot, *view.quantizer, query, options);
  for (auto* images : {&ranking.candidates, &ranking.best}) {
    for (RankedImage& image : *images) image.ref.collection = view.collection;
  }
  return ranking;
}

Ranking EngineCore::RankParts(const CollectionView& view, const RankQuery& query,
                              const RankOptions& options) {
  const auto rank = [&, followed = ranker_->followed()](const CollectionView& in,
                                                        const RankQuery& in_words) {
    return RankInParts(options_.part_servers,
                       {database_, followed, in.name, in.collection, in.vocabulary}, in_words,
                       options);
  };
  try {
    return rank(view, query);
  } catch (const Error& error) {
    // Another part may still load the vocabulary that was switched to.
    const auto previous = ranker_->Previous(view.name);
    if (error.reason() != "part_unavailable" || !previous ||
        query.method == RankMethod::kHistogram) {
      throw;
    }
    return rank(*previous, NeighboursOf(query.descriptors, query.weights, *previous->quantizer,
                                        options.threads));
  }
}

void EngineCore::Follow() {
  try {
    ranker_->Follow();
  } catch (const std::exception& error) {
    if (options_.warn) {
      options_.warn(std::string("the index cannot load the latest changes: ") + error.what());
    }
    throw;
  }
}

void EngineCore::CheckModel(const DescriptorInfo& info) const {
  const std::string& model_id = store_->model().info.model_id;
  if (info.model_id == model_id) return;
  throw Error(ErrorCode::kConflict, "model_mismatch",
              "the database " + options_.database.string() + " was made with " + model_id +
                  ", but the descriptor is " + info.model_id +
                  "; use that descriptor, or index into a new database");
}

void EngineCore::CheckFeatures(const Features& features) const {
  const DescriptorInfo& model = store_->model().info;
  const Descriptors& d = features.descriptors;
  const bool fits = d.rows == 0 || (d.kind == model.kind && d.dim == model.dim);
  if (features.model_id == model.model_id && fits) return;
  throw Error(ErrorCode::kConflict, "model_mismatch",
              "The features are of " + features.model_id + " with " + std::to_string(d.dim) +
                  " components, but the database uses " + model.model_id + " with " +
                  std::to_string(model.dim) + ".");
}

void EngineCore::FollowLimits(const ExtractionLimits& stored, ExtractionOptions& extraction) const {
  const auto follow = [&](const char* name, int limit, const std::optional<int>& wanted,
                          int& value) {
    if (wanted && limit != 0 && *wanted != limit) {
      throw Error(ErrorCode::kConflict, "extraction_mismatch",
                  "the database " + options_.database.string() + " was made with " + name + " " +
                      std::to_string(limit) + ", not " + std::to_string(*wanted) +
                      "; omit the option to use the stored value, or index into a new database");
    }
    value = limit != 0 ? limit : wanted.value_or(value);
  };
  follow("max_keypoints", stored.max_keypoints, options_.max_keypoints,
         extraction.keypoints.max_keypoints);
  follow("max_side_px", stored.max_side_px, options_.max_side_px, extraction.decode.max_side_px);
}

// Before the first image is described. With no limit to the side there is nothing to write down
// for it: 0 means "not decided".
void EngineCore::StoreLimits(ExtractionOptions& extraction) {
  if (limits_stored_ || options_.read_only) return;
  FollowLimits(
      store_->SettleExtraction({extraction.keypoints.max_keypoints, extraction.decode.max_side_px}),
      extraction);
  limits_stored_ = true;
}

const EngineCore::Extractors& EngineCore::extractors() {
  const std::lock_guard lock(extractors_mutex_);
  if (!extractors_) {
    std::shared_ptr<const Descriptor> descriptor =
        MakeDescriptorFor(options_, store_->model().info);
    CheckModel(descriptor->info());
    ExtractionOptions extraction = options_.extraction;  // others read that
    StoreLimits(extraction);
    const int kept = extraction.keypoints.max_keypoints;
    ExtractionOptions query = QueryExtraction(extraction);
    ExtractionOptions indexed = query;
    indexed.keep = kept;
    indexed.enlarge_below = options_.enlarge ? kept : 0;
    if (!options_.enlarge) query.enlarge_below = 0;
    query.colour_side = kQueryColourSide;
    query.preview_side_px = kQueryPreviewSide;
    extractors_ = std::make_unique<const Extractors>(
        Extractors{{descriptor, indexed}, {std::move(descriptor), query}});
  }
  return *extractors_;
}

Features EngineCore::GetFeatures(const ImageRef& ref, const std::string& collection) {
  const auto found = catalogue().LoadImages({&ref, 1}, Load::kRecordsAndFeatures).front();
  if (!found) throw refusals::NoImage(collection, ref.id);
  Features features = DecodeFeatures(found->features);
  features.model_id = model().model_id;
  return features;
}

Engine::Engine(EngineOptions options) : core_(std::make_unique<EngineCore>(std::move(options))) {}

Engine::~Engine() = default;

std::string Engine::RankPart(const IndexShare& share, const std::string& message, int threads,
                             std::chrono::steady_clock::time_point until) {
  if (share != core_->options().share) {
    throw Error(ErrorCode::kNotFound, "part_elsewhere", "This server does not hold this part.");
  }
  return core_->part_answers().Answer(core_->ranker(), core_->database(), message, threads, until);
}

std::int64_t Engine::followed() { return core_->ranker().followed(); }

const std::string& Engine::database() const { return core_->database(); }

EngineStats Engine::Stats() {
  EngineStats stats = core_->catalogue().Count();
  stats.index_bytes = core_->ranker().memory_bytes();
  if (stats.server) {
    stats.server->behind =
        std::max<std::int64_t>(0, stats.server->commit - core_->ranker().followed());
  }
  return stats;
}

std::vector<std::string> Engine::Check() {
  const std::vector<std::string> problems = core_->catalogue().Check();
  if (!problems.empty()) return problems;  // the index cannot be better than what it is made from
  return core_->ranker().Check();
}

std::uint64_t Engine::SweepOriginals() { return core_->writer().SweepOriginals(); }

MoveOriginalsResult Engine::MoveOriginals(const std::filesystem::path& directory,
                                          const std::function<void(double)>& progress) {
  return core_->writer().MoveOriginals(directory, progress);
}

std::optional<OriginalsRecord> Engine::DescribeOriginals() {
  return core_->catalogue().DescribeOriginals();
}

void Engine::Backup(const std::filesystem::path& target, const std::stop_token& stop) {
  core_->catalogue().Backup(target, stop);
}

}  // namespace pliant
