// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Statements that list what may be purged, as texts that can stand in IN (...). Private to
// store/clickhouse.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "index/store/clickhouse/cluster_link.h"
#include "index/store/clickhouse/registry.h"

namespace pliant::clickhouse {

// A statement that removes rows stands at the Keeper, which takes a megabyte.
inline constexpr std::size_t kValuesAStatement = 2000;

struct MayGo {
  PurgeEntry limits;
  std::uint64_t keys_below = 0;  // of collections and vocabularies: who is not listed is gone
  std::vector<std::uint64_t> collections;
  std::vector<std::uint64_t> vocabularies;
};

// The only column of all lists is "value": a literal.
std::vector<std::string> ListOf(const NativeBlock& rows);
std::vector<std::string> ReadList(ClusterLink& link, std::size_t shard,
                                  const std::string& statement);
std::string Joined(std::span<const std::string> values);

std::string GoneCollections(const MayGo& may);  // a condition of pictures
std::string GoneVocabularies(const MayGo& may, const std::string& table);
std::string ReplacedStates(const MayGo& may);   // versions
std::string LastRemovals(const MayGo& may);     // versions; to be asked of each replica
std::string ReplacedEntries(const MayGo& may);  // versions of the registry
std::string LastRemovedEntries(const MayGo& may);

struct Unused {
  std::string table;
  std::string key;        // an expression of columns that the table and pictures have
  bool is_text = false;   // not a number
  std::string more = {};  // which states count, but for all: " AND content = 1"

  std::string List(const MayGo& may) const;  // those that no state has
  // Those of `values` that a state has which is newer than what may go.
  std::string NewerOf(const MayGo& may, const std::string& values) const;
};

std::vector<Unused> UnusedRows();

}  // namespace pliant::clickhouse
