// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Engine: searching the part of a database that answers.
#include "descriptor/base/error.h"
#include "index/engine/engine_impl.h"

namespace pliant {
namespace {

// Not because something is wrong with what was asked: a part of the store does not answer.
bool IsNoAnswer(const Error& error) {
  return error.reason() == "shard_unavailable" || error.reason() == "database_timeout";
}

}  // namespace

void Engine::Impl::Reading(bool partial, const std::function<void(const Source&)>& work) {
  if (!partial) return work({catalogue()});
  // Each time a further shard may be missed; once more, for one that comes back meanwhile.
  for (std::size_t left = catalogue().CountShards() + 1;; --left) {
    try {
      const std::unique_ptr<PartialSource> part = catalogue().Partial();
      if (part) return work({*part, part.get()});
      return work({catalogue()});
    } catch (const Error& error) {
      if (!IsNoAnswer(error) || left == 0) throw;
    }
  }
}

CollectionView Engine::Impl::ViewOf(const Source& source, const std::string& collection) {
  const std::string name = source.reads.RequireCollection(collection).name;
  if (source.part == nullptr) return ranker_->View(name);
  if (source.part->follows()) {
    try {
      return ranker_->View(name);
    } catch (const Error& error) {
      if (!IsNoAnswer(error)) throw;  // what has changed on a shard that is gone
    }
  }
  if (auto last = ranker_->LastView(name)) return *std::move(last);
  throw Error(
      ErrorCode::kUnavailable, "shard_unavailable",
      "a shard does not answer, and the index of collection \"" + name + "\" is not in memory yet");
}

Coverage Engine::Impl::CoverageOf(const Source& source, const CollectionView& view) {
  const std::uint64_t known = ranker_->Size(view);
  if (source.part == nullptr) {
    const std::size_t shards = catalogue().CountShards();
    return {shards, shards, known, known};
  }
  Coverage coverage = source.part->Cover(view.collection);
  if (!options_.partial) coverage.total_pictures = known;  // in memory since all shards answered
  return coverage;
}

}  // namespace pliant
