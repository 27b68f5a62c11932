// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Pictures as they were at a commit, read from all shards.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "index/records/picture_ref.h"
#include "index/records/records.h"
#include "index/store/clickhouse/cluster_link.h"
#include "index/store/clickhouse/rows.h"

namespace pliant::clickhouse {

// A row of `pictures`.
struct PictureState {
  std::size_t shard = 0;  // where it was read
  std::uint64_t version = 0;
  std::uint32_t collection = 0;
  std::uint32_t picture = 0;  // the number of its description
  bool deleted = false;
  bool content = false;  // the uploaded bytes are kept
  ImageRecord record;    // without the collection's name
};

// What lists are made of.
struct PictureOutline {
  std::uint64_t version = 0;
  std::uint32_t picture = 0;
  std::string id;
  std::string object;
  std::string source;
  std::string metadata;  // empty unless asked for
  std::uint32_t keypoints = 0;
  std::int64_t added_ms = 0;
  std::int64_t updated_ms = 0;
};

struct OutlineQuery {
  std::uint32_t collection = 0;
  std::uint64_t log = 0;                   // Snapshot::log
  std::optional<std::string> object = {};  // "" = without one
  bool metadata = false;
  std::string more = {};  // further conditions on the result, as SQL: " AND v > 5"
  std::string end = {};   // " ORDER BY id LIMIT 10", of each shard
};

// An object as rankers know it: never 0 for one with a name. (64 bits of its name's SHA-256.)
Key ObjectKey(const std::string& object);

void AddRow(RowWriter& rows, const PictureState& state);

// Picture numbers by the shard that has them, which is that of the picture's id.
using NumbersByShard = std::map<std::size_t, std::vector<std::uint64_t>>;

// Thread-safe. Pictures that are gone are left out. Throws what ClusterLink throws. What is asked
// for by id is asked of the shard of the id alone.
class PictureStates {
 public:
  // `only`: these shards are read where all would be; what is elsewhere is not seen.
  explicit PictureStates(ClusterLink* link,
                         std::optional<std::vector<std::size_t>> only = std::nullopt)
      : link_(*link), only_(std::move(only)) {}

  // In any order.
  std::vector<PictureState> ByIds(std::uint32_t collection, const std::vector<std::string>& ids,
                                  std::uint64_t log);
  std::vector<PictureState> ByRefs(const std::vector<std::pair<std::uint32_t, std::string>>& refs,
                                   std::uint64_t log);
  std::optional<PictureState> ById(std::uint32_t collection, const std::string& id,
                                   std::uint64_t log);
  // With these bytes, in order of collection and id.
  std::vector<PictureState> BySha256(const std::vector<std::string>& sha256, std::uint64_t log);

  // Of the whole collection, but for what the query leaves out; in any order unless it has one.
  std::vector<PictureOutline> Outlines(const OutlineQuery& query);

  // The encoded features of picture numbers; what is missing is left out.
  std::map<std::uint32_t, std::vector<std::uint8_t>> Features(
      const std::vector<std::uint64_t>& pictures);
  std::map<std::uint32_t, std::vector<std::uint8_t>> Features(const NumbersByShard& pictures);
  // The encoded words of picture numbers in a vocabulary, likewise.
  std::map<std::uint32_t, std::vector<std::uint8_t>> Words(
      Key vocabulary, const std::vector<std::uint64_t>& pictures);

 private:
  std::vector<std::size_t> Shards();
  std::vector<std::size_t> ShardsOf(std::uint32_t collection, const std::vector<std::string>& ids);
  std::vector<PictureState> Select(const std::vector<std::size_t>& shards, const std::string& where,
                                   std::uint64_t log, const std::string& then);
  std::map<std::uint32_t, std::vector<std::uint8_t>> FeaturesOn(
      const std::vector<std::size_t>& shards, const std::vector<std::uint64_t>& pictures);
  std::map<std::uint32_t, std::vector<std::uint8_t>> Blobs(const std::vector<std::size_t>& shards,
                                                           const std::string& statement);

  ClusterLink& link_;
  const std::optional<std::vector<std::size_t>> only_;
};

}  // namespace pliant::clickhouse
