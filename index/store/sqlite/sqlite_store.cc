// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A store on one database file.
#include "descriptor/base/error.h"
#include "index/files/durable_file.h"
#include "index/store/database_file.h"
#include "index/store/database_url.h"
#include "index/store/open_store.h"
#include "index/store/sqlite/access.h"
#include "index/store/sqlite/database.h"
#include "index/store/sqlite/new_database.h"
#include "index/store/sqlite/originals_keeper.h"
#include "index/store/sqlite/sqlite_catalogue.h"
#include "index/store/sqlite/sqlite_feed.h"
#include "index/store/sqlite/sqlite_writer.h"

namespace pliant {
namespace {

class SqliteStore : public Store {
 public:
  explicit SqliteStore(const StoreOptions& options)
      : access_(options.database, options.busy_timeout_ms, options.reserve_bytes),
        originals_(&access_),
        model_(access_.Read([](Connection& db) { return ReadModel(db); })),
        catalogue_(&access_, &originals_, &model_),
        writer_(&access_, &originals_, &model_) {}

  const StoredModel& model() const override { return model_.model; }
  ExtractionLimits SettleExtraction(const ExtractionLimits& limits) override {
    ExtractionLimits settled;
    access_.WriteAlone([&](Connection& db) {
      StoreExtraction(db, model_.key, limits);
      settled = ReadModel(db).model.limits;
    });
    return settled;
  }
  void OpenOriginals(const std::optional<std::filesystem::path>& directory, bool claim) override {
    originals_.Open(directory, claim);
  }
  void BeginWriting(std::function<void()> after_commit) override {
    access_.BeginWriting(std::move(after_commit));
  }
  Catalogue& catalogue() override { return catalogue_; }
  Writer& writer() override { return writer_; }
  std::unique_ptr<ChangeFeed> OpenFeed() override { return std::make_unique<SqliteFeed>(&access_); }

 private:
  Access access_;
  OriginalsKeeper originals_;
  const ModelRow model_;
  SqliteCatalogue catalogue_;
  SqliteWriter writer_;
};

}  // namespace

std::unique_ptr<Store> OpenStore(const StoreOptions& options) {
  if (IsDatabaseUrl(options.database.string())) {
    throw Error(ErrorCode::kInvalidArgument, "database_unsupported",
                "databases with a URL cannot be opened yet; name a database file");
  }
  const std::filesystem::path& file = options.database;
  RequireDatabaseFile(file);
  WithDatabaseErrors(file, [&] {
    if (!options.read_only) RemoveAbandoned(file);
    if (InspectDatabaseFile(file) != FileState::kPliant) {
      if (!options.create || options.read_only) {
        throw Error(ErrorCode::kNotFound, "database_not_found",
                    "there is no database " + DisplayPath(file));
      }
      CreateDatabase(file, options.model_of_new());
    }
    UpgradeDatabase(file,
                    options.read_only ? Connection::Mode::kReadOnly : Connection::Mode::kReadWrite,
                    options.busy_timeout_ms);
  });
  return std::make_unique<SqliteStore>(options);
}

}  // namespace pliant
