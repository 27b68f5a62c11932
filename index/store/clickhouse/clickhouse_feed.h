// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The changes of a cluster. Private to store/clickhouse.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "index/store/change_feed.h"
#include "index/store/clickhouse/picture_states.h"
#include "index/store/clickhouse/snapshot.h"

namespace pliant::clickhouse {

// Throws kCorrupt "vocabulary_corrupt", and what ClusterLink throws.
std::shared_ptr<const Vocabulary> ReadVocabulary(ClusterLink& link, const Registry& registry,
                                                 Key vocabulary);

class ClickhouseFeed : public ChangeFeed {
 public:
  ClickhouseFeed(ClusterLink* link, Snapshots* snapshots) : link_(*link), snapshots_(*snapshots) {}

  std::int64_t Version() override;
  std::unique_ptr<FeedView> Look() override;

 private:
  ClusterLink& link_;
  Snapshots& snapshots_;
  std::atomic<std::uint64_t> looked_{0};  // the version of the last look
  std::atomic<std::uint64_t> told_{0};    // the greatest version that was told, or looked at
};

}  // namespace pliant::clickhouse
