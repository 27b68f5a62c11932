// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Both sides of a ranking in parts (index_parts.h). Private to engine/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "index/engine/index_parts.h"
#include "index/rank/memory_ranker.h"
#include "index/rank/ranking.h"

namespace pliant {

// What parts must have reached.
struct PartState {
  std::string database;  // Store::Identity
  std::int64_t followed = 0;
  std::string name;  // of the collection
  Key collection = 0;
  Key vocabulary = 0;
};

// Asks all parts. `servers`: the present configuration, which can change meanwhile. Throws
// kUnavailable "part_unavailable".
Ranking RankInParts(const std::function<std::shared_ptr<PartServers>()>& servers,
                    const PartState& state, const RankQuery& query, const RankOptions& options);

// Answers for one part. Thread-safe.
class PartAnswers {
 public:
  // Nothing is ranked after `until`. Throws kNotFound "part_elsewhere" for another database, for a
  // vocabulary or a state that is not here, and for unknown tokens: another server may know them;
  // kConflict "part_changed"; kInvalidArgument "peer_message_invalid".
  std::string Answer(MemoryRanker& ranker, const std::string& database, const std::string& message,
                     int threads, PartServers::Clock::time_point until);

 private:
  struct Kept;

  std::shared_ptr<Kept> Take(const std::string& token);
  void Keep(std::shared_ptr<Kept> kept);

  std::mutex mutex_;                        // guards the rest
  std::deque<std::shared_ptr<Kept>> kept_;  // the newest first
};

}  // namespace pliant
