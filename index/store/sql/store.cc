// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/store.h"

#include "index/store/open_store.h"
#include "index/store/sql/access.h"
#include "index/store/sql/integrity.h"
#include "index/store/sql/originals.h"
#include "index/store/sql/rows.h"

namespace pliant {

ModelRow ReadModel(Connection& db) {
  Cursor row = db.Prepare(
      "SELECT key, name, model_id, kind, dim, coalesce(max_keypoints, 0), coalesce(max_side, 0) "
      "FROM models ORDER BY key LIMIT 1");
  row.One();
  return {row.Int(0),
          {{row.Text(1), static_cast<DescriptorKind>(row.Int(3)), static_cast<int>(row.Int(4)),
            row.Text(2)},
           {static_cast<int>(row.Int(5)), static_cast<int>(row.Int(6))}}};
}

void InsertFirstRows(Connection& db, const DescriptorInfo& model) {
  const Key key =
      db.Prepare("INSERT INTO models (name, model_id, kind, dim) VALUES (?, ?, ?, ?) RETURNING key")
          .Bind(model.name, model.model_id, static_cast<int>(model.kind), model.dim)
          .One()
          .Int(0);
  InsertCollection(db, kDefaultCollection, key);
}

Store::Store(std::unique_ptr<Access> access)
    : access_(std::move(access)),
      model_(std::make_unique<const ModelRow>(
          access_->Read([](Connection& db) { return ReadModel(db); }))),
      originals_(std::make_unique<OriginalsKeeper>(access_.get())),
      catalogue_(access_.get(), originals_.get(), model_.get()),
      writer_(access_.get(), originals_.get(), model_.get()) {}

Store::~Store() = default;

std::string Store::Identity() const { return access_->Identity(); }

const StoredModel& Store::model() const { return model_->model; }

ExtractionLimits Store::SettleExtraction(const ExtractionLimits& limits) {
  ExtractionLimits settled;
  access_->WriteAlone([&](Connection& db) {
    db.Prepare(
          "UPDATE models SET max_keypoints = coalesce(max_keypoints, nullif(?1, 0)), "
          "max_side = coalesce(max_side, nullif(?2, 0)) WHERE key = ?3")
        .Bind(limits.max_keypoints, limits.max_side_px, model_->key)
        .Run();
    settled = ReadModel(db).model.limits;
  });
  return settled;
}

void Store::OpenOriginals(const std::optional<std::filesystem::path>& directory, bool claim) {
  originals_->Open(directory, claim);
}

void Store::BeginWriting(std::function<void()> after_commit) {
  access_->BeginWriting(std::move(after_commit));
}

std::jthread Store::FollowOthers(const std::function<void()>& wake) {
  return access_->FollowOthers(wake);
}

std::unique_ptr<Store> OpenStore(const StoreOptions& options) {
  return std::make_unique<Store>(OpenAccess(options, StorePart::kImages));
}

EngineStats Catalogue::Count() {
  return access_.Read([&](Connection& db) {
    EngineStats stats;
    for (const CollectionRow& collection : AllCollections(db)) {
      stats.images += collection.images;
      stats.objects += collection.objects;
      stats.descriptors += collection.descriptors;
    }
    stats.database_bytes = access_.SizeBytes();
    stats.server = access_.ServerFigures();
    stats.descriptor = model_.model.info.name;
    stats.model_id = model_.model.info.model_id;
    if (const auto collection = FindCollection(db, kDefaultCollection)) {
      stats.vocabulary = pliant::FindVocabulary(db, *collection, collection->active_vocabulary);
    }
    return stats;
  });
}

std::vector<std::string> Catalogue::Check() {
  if (access_.writes()) originals_.RemoveDropped();
  std::vector<std::string> problems = access_.Read([&](Connection& db) {
    std::vector<std::string> found;
    if (access_.CheckStructure(db, &found)) CheckRows(db, &found);
    return found;
  });
  for (std::string& problem : originals_.Check()) problems.push_back(std::move(problem));
  return problems;
}

void Catalogue::Backup(const std::filesystem::path& target, const std::stop_token& stop) {
  access_.Backup(target, stop);
}

std::optional<OriginalsRecord> Catalogue::DescribeOriginals() { return originals_.Describe(); }

}  // namespace pliant
