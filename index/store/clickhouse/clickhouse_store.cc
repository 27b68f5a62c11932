// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/clickhouse_store.h"

#include <utility>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/clickhouse_catalogue.h"
#include "index/store/clickhouse/clickhouse_feed.h"
#include "index/store/clickhouse/clickhouse_writer.h"
#include "index/store/cluster_scheme.h"

namespace pliant::clickhouse {
namespace {

DatabaseUrl RequireKeepers(DatabaseUrl url) {
  if (url.keepers.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "database_url_invalid",
                "the database's URL names no Keeper: add ?keeper=HOST:2181,...");
  }
  return url;
}

KeeperOptions KeeperOf(const DatabaseUrl& url) {
  KeeperOptions options;
  options.hosts = url.keepers;
  options.root = "/pliant/" + url.database;
  return options;
}

class ClickhouseStore : public Store {
 public:
  explicit ClickhouseStore(const StoreOptions& options)
      : access_(options.database.string(), {}, options.partial),
        catalogue_(&access_.link, &access_.snapshots, access_.password),
        writer_(&access_.link, &access_.commits, &catalogue_) {
    auto model = access_.snapshots.Now().registry->model;
    if (!model) model = Create(options);
    model_ = *std::move(model);
  }

  const StoredModel& model() const override { return model_; }

  ExtractionLimits SettleExtraction(const ExtractionLimits& limits) override {
    ExtractionLimits settled;
    access_.commits.RunAtOpening([&](Change& change) {
      StoredModel model = change.registry().model.value();
      settled = model.limits;
      if (settled.max_keypoints == 0) settled.max_keypoints = limits.max_keypoints;
      if (settled.max_side_px == 0) settled.max_side_px = limits.max_side_px;
      if (settled.max_keypoints == model.limits.max_keypoints &&
          settled.max_side_px == model.limits.max_side_px) {
        return;
      }
      model.limits = settled;
      change.Set(ToRow(model));
    });
    return settled;
  }

  void OpenOriginals(const std::optional<std::filesystem::path>& directory,
                     bool /*claim*/) override {
    if (!directory || directory->empty()) return;
    throw Error(ErrorCode::kInvalidArgument, "originals_in_cluster",
                "a cluster keeps the uploaded bytes itself; leave out the directory for them");
  }
  void BeginWriting(std::function<void()> after_commit) override {
    access_.commits.Begin(std::move(after_commit));
  }

  Catalogue& catalogue() override { return catalogue_; }
  Writer& writer() override { return writer_; }
  std::unique_ptr<ChangeFeed> OpenFeed() override {
    return std::make_unique<ClickhouseFeed>(&access_.link, &access_.snapshots);
  }

 private:
  // Another process may be first.
  StoredModel Create(const StoreOptions& options) {
    if (!options.create || options.read_only) {
      throw Error(ErrorCode::kNotFound, "database_not_found",
                  "the cluster's database " + access_.link.url().database +
                      " is empty: nothing was ever stored in it");
    }
    StoredModel model;
    model.info = options.model_of_new();
    access_.commits.RunAtOpening([&](Change& change) {
      if (change.registry().model) {
        model = *change.registry().model;
        return;
      }
      change.Set(ToRow(model));
      CollectionEntry collection;
      collection.key = static_cast<std::uint32_t>(change.NewKey());
      collection.name = kDefaultCollection;
      collection.created_ms = NowMs();
      change.Set(ToRow(collection));
    });
    return model;
  }

  ClusterAccess access_;
  StoredModel model_;
  ClickhouseCatalogue catalogue_;
  ClickhouseWriter writer_;
};

}  // namespace

ClusterAccess::ClusterAccess(const std::string& url, const std::string& password_file, bool partial)
    : password(ReadDatabasePassword(password_file)),
      link(RequireKeepers(ParseDatabaseUrl(url)), password, partial),
      snapshots(&link),
      keeper(std::make_shared<Keeper>(KeeperOf(link.url()))),
      commits(&link, &snapshots, keeper),
      readers(&snapshots, keeper) {}

std::unique_ptr<Store> OpenClickhouseStore(const StoreOptions& options) {
  return std::make_unique<ClickhouseStore>(options);
}

}  // namespace pliant::clickhouse

namespace pliant {

void UseClusters() {
  SetClusterOpener({&clickhouse::OpenClickhouseStore, &clickhouse::OpenClickhouseServiceStore});
}

}  // namespace pliant
