// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/engine/engine.h"

#include "descriptor/base/error.h"
#include "index/engine/engine_impl.h"
#include "index/files/text.h"
#include "index/store/sqlite/catalogue_vocabularies.h"
#include "index/store/sqlite/database.h"
#include "index/store/sqlite/integrity.h"

namespace pliant {
namespace {

std::shared_ptr<const Descriptor> MakeDescriptorFor(const EngineOptions& options,
                                                    const std::string& database_descriptor) {
  if (options.custom_descriptor) return options.custom_descriptor;
  return MakeDescriptor(options.descriptor.empty() ? database_descriptor : options.descriptor,
                        options.descriptor_options);
}

std::uint64_t SizeOf(const std::filesystem::path& path) {
  std::error_code error;  // side files come and go
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  return error ? 0 : size;
}

void CheckPage(int limit) {
  if (limit < 1 || limit > 1000) {
    throw Error(ErrorCode::kInvalidArgument, "limit_invalid",
                "limit must be 1 to 1000, not " + std::to_string(limit));
  }
}

}  // namespace

Engine::Impl::Impl(EngineOptions options) : options_(std::move(options)) {
  const std::filesystem::path& file = options_.database;
  WithDatabaseErrors(file, [&] {
    const auto mode =
        options_.read_only ? Connection::Mode::kReadOnly : Connection::Mode::kReadWrite;
    if (InspectDatabaseFile(file) != FileState::kPliant) {
      if (!options_.create || options_.read_only) {
        throw Error(ErrorCode::kNotFound, "database_not_found",
                    "there is no database " + DisplayPath(file));
      }
      const std::shared_ptr<const Descriptor> descriptor = MakeDescriptorFor(options_, "deal");
      CreateDatabase(file, descriptor->info());
      options_.custom_descriptor = descriptor;
    }
    UpgradeDatabase(file, mode, options_.busy_timeout_ms);
    readers_ = std::make_unique<ConnectionPool>(file, options_.busy_timeout_ms);
    model_ = Read([](Connection& db) { return ReadModel(db); });
    SettleExtraction();
    OpenOriginals();
    if (options_.custom_descriptor) {  // another process may have made the database meanwhile
      CheckModel(options_.custom_descriptor->info());
    }
    if (options_.load_descriptor) extractor();
    state_ = std::make_unique<IndexState>(
        std::make_unique<Connection>(file, Connection::Mode::kReadOnly, options_.busy_timeout_ms),
        options_.loading);
    if (options_.load_index) state_->CatchUp();
    if (!options_.read_only) {
      writer_ = std::make_unique<WriteQueue>(
          std::make_unique<Connection>(file, mode, options_.busy_timeout_ms),
          [this] { state_->CatchUpIfLoaded(); });
    }
  });
}

void Engine::Impl::Write(WriteQueue::Work work, bool reclaim) {
  if (!writer_) {
    throw Error(ErrorCode::kNoSpace, "read_only",
                "the database " + DisplayPath(path()) + " is open for reading only");
  }
  WithDatabaseErrors(path(), [&] { writer_->Run(std::move(work), reclaim); });
}

void Engine::Impl::CheckModel(const DescriptorInfo& info) const {
  if (info.model_id == model_.info.model_id) return;
  throw Error(ErrorCode::kConflict, "model_mismatch",
              "the database " + DisplayPath(path()) + " was made with " + model_.info.model_id +
                  ", but the descriptor is " + info.model_id +
                  "; use that one, or index into a new database");
}

void Engine::Impl::SettleExtraction() {
  const auto settle = [&](const char* name, int stored, const std::optional<int>& wanted,
                          int& value) {
    if (wanted && stored != 0 && *wanted != stored) {
      throw Error(ErrorCode::kConflict, "extraction_mismatch",
                  "the database " + DisplayPath(path()) + " was made with " + name + " " +
                      std::to_string(stored) + ", not " + std::to_string(*wanted) +
                      "; leave it out to follow, or index into a new database");
    }
    value = stored != 0 ? stored : wanted.value_or(value);
  };
  int& max_keypoints = options_.extraction.keypoints.max_keypoints;
  int& max_side_px = options_.extraction.decode.max_side_px;
  settle("max_keypoints", model_.max_keypoints, options_.max_keypoints, max_keypoints);
  settle("max_side_px", model_.max_side_px, options_.max_side_px, max_side_px);
  const bool decided = model_.max_keypoints != 0 && model_.max_side_px != 0;
  // With no limit to the side there is nothing to write down: 0 means "not decided".
  if (decided || options_.read_only || !options_.load_descriptor) return;
  Connection db(path(), Connection::Mode::kReadWrite, options_.busy_timeout_ms);
  StoreExtraction(db, model_.key, max_keypoints, max_side_px);
}

const FeatureExtractor& Engine::Impl::extractor() {
  const std::lock_guard lock(extractor_mutex_);
  if (!extractor_) {
    std::shared_ptr<const Descriptor> descriptor = MakeDescriptorFor(options_, model_.info.name);
    CheckModel(descriptor->info());
    extractor_ =
        std::make_unique<const FeatureExtractor>(std::move(descriptor), options_.extraction);
  }
  return *extractor_;
}

CollectionView Engine::Impl::CurrentView(const std::string& collection) {
  return WithDatabaseErrors(path(), [&] {
    state_->CatchUp();
    return state_->Find(collection);
  });
}

EngineStats Engine::Impl::Stats() {
  WithDatabaseErrors(path(), [&] { state_->CatchUp(); });
  return Read([&](Connection& db) {
    EngineStats stats;
    for (const CollectionRow& collection : AllCollections(db)) {
      stats.images += collection.images;
      stats.objects += collection.objects;
      stats.descriptors += collection.descriptors;
    }
    stats.database_bytes = SizeOf(path()) + SizeOf(path().string() + "-wal");
    stats.index_bytes = state_->memory_bytes();
    stats.descriptor = model_.info.name;
    stats.model_id = model_.info.model_id;
    if (const auto collection = FindCollection(db, kDefaultCollection)) {
      stats.vocabulary = FindVocabulary(db, *collection, collection->active_vocabulary);
    }
    return stats;
  });
}

std::vector<std::string> Engine::Impl::Check() {
  if (writer_) RemoveDroppedOriginals();
  std::vector<std::string> problems = Read([](Connection& db) { return CheckDatabase(db); });
  const std::vector<std::string> files = CheckOriginals();
  problems.insert(problems.end(), files.begin(), files.end());
  if (!problems.empty()) return problems;  // the index cannot be better than what it is made from
  return WithDatabaseErrors(path(), [&] { return state_->Compare(); });
}

Engine::Engine(EngineOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Engine::~Engine() = default;

bool Engine::CreateCollection(const std::string& name) { return impl_->CreateCollection(name); }

std::vector<std::string> Engine::ListCollections() {
  return impl_->Read([](Connection& db) {
    std::vector<std::string> names;
    for (const CollectionRow& row : AllCollections(db)) names.push_back(row.name);
    return names;
  });
}

bool Engine::RemoveCollection(const std::string& name) { return impl_->RemoveCollection(name); }

AddResult Engine::Add(const AddRequest& request) { return impl_->Add(request); }

std::optional<ImageRecord> Engine::FindBySha256(const std::string& collection,
                                                const std::string& sha256) {
  return impl_->Read([&](Connection& db) -> std::optional<ImageRecord> {
    const auto found = FindPictureBySha256(db, RequireCollection(db, collection).key, sha256);
    if (!found) return std::nullopt;
    return found->record;
  });
}

ImageRecord Engine::Get(const std::string& collection, const std::string& id) {
  return impl_->Read(
      [&](Connection& db) { return impl_->RequirePicture(db, collection, id).record; });
}

Features Engine::GetFeatures(const std::string& collection, const std::string& id) {
  return impl_->GetFeatures(collection, id);
}

std::vector<std::uint8_t> Engine::GetContent(const std::string& collection, const std::string& id) {
  return impl_->GetContent(collection, id);
}

std::vector<ImageRecord> Engine::List(const ListOptions& options) {
  CheckPage(options.limit);
  return impl_->List(options);
}

bool Engine::Remove(const std::string& collection, const std::string& id) {
  return impl_->Remove(collection, id);
}

std::vector<ObjectRecord> Engine::ListObjects(const std::string& collection,
                                              const std::string& after, int limit) {
  CheckPage(limit);
  return impl_->Read([&](Connection& db) {
    return SelectObjects(db, RequireCollection(db, collection).key, after, limit);
  });
}

std::uint64_t Engine::RemoveObject(const std::string& collection, const std::string& object) {
  return impl_->RemoveObject(collection, object);
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

SearchResult Engine::SearchFeatures(const Features& features, const SearchOptions& options) {
  return impl_->SearchFeatures(features, options);
}

VocabularyRecord Engine::TrainVocabulary(const TrainOptions& options) {
  return impl_->TrainVocabulary(options);
}

std::vector<VocabularyRecord> Engine::ListVocabularies(const std::string& collection) {
  return impl_->Read(
      [&](Connection& db) { return SelectVocabularies(db, RequireCollection(db, collection)); });
}

void Engine::UseVocabulary(const std::string& collection, std::int64_t id,
                           const UseOptions& options) {
  impl_->UseVocabulary(collection, id, options);
}

std::uint64_t Engine::CountUnquantized(const std::string& collection, std::int64_t id) {
  return impl_->Read([&](Connection& db) {
    return CountPicturesWithoutWords(db, RequireCollection(db, collection).key, id);
  });
}

EngineStats Engine::Stats() { return impl_->Stats(); }

std::vector<std::string> Engine::Check() { return impl_->Check(); }

std::uint64_t Engine::SweepOriginals() { return impl_->SweepOriginals(); }

MoveOriginalsResult Engine::MoveOriginals(const std::filesystem::path& directory,
                                          const std::function<void(double)>& progress) {
  return impl_->MoveOriginals(directory, progress);
}

std::optional<OriginalsRecord> Engine::DescribeOriginals() { return impl_->DescribeOriginals(); }

void Engine::Backup(const std::filesystem::path& target) {
  WithDatabaseErrors(impl_->path(), [&] {
    // A connection of its own: a backup may take long and must not see its source written by the
    // same connection.
    Connection source(impl_->path(), Connection::Mode::kReadOnly, 10'000);
    BackupDatabase(source, target);
  });
}

}  // namespace pliant
