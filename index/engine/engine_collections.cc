// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Collections and their names.
#include "descriptor/base/error.h"
#include "index/engine/engine.h"
#include "index/engine/engine_impl.h"
#include "index/files/names.h"

namespace pliant {

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
