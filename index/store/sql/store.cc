// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/store.h"

#include "index/store/open_store.h"
#include "index/store/sql/access.h"
#include "index/store/sql/change_feed.h"
#include "index/store/sql/originals.h"
#include "index/store/sql/rows.h"

namespace pliant {

Store::Store(std::unique_ptr<Access> access)
    : access_(std::move(access)),
      model_(std::make_unique<const ModelRow>(
          access_->Read([](Connection& db) { return ReadModel(db); }))),
      originals_(std::make_unique<OriginalsKeeper>(access_.get())),
      catalogue_(access_.get(), originals_.get(), model_.get()),
      writer_(access_.get(), originals_.get(), model_.get()) {}

Store::~Store() = default;

const StoredModel& Store::model() const { return model_->model; }

ExtractionLimits Store::SettleExtraction(const ExtractionLimits& limits) {
  ExtractionLimits settled;
  access_->WriteAlone([&](Connection& db) {
    StoreExtraction(db, model_->key, limits);
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

std::jthread Store::FollowOthers(std::function<void()> wake) {
  return access_->FollowOthers(std::move(wake));
}

std::unique_ptr<ChangeFeed> Store::OpenFeed() { return std::make_unique<SqlFeed>(access_.get()); }

std::unique_ptr<Store> OpenStore(const StoreOptions& options) {
  return std::make_unique<Store>(OpenAccess(options, StorePart::kImages));
}

}  // namespace pliant
