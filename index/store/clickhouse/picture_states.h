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

// Thread-safe. Pictures that are gone are left out. Throws what ClusterLink throws.
class PictureStates {
 public:
  explicit PictureStates(ClusterLink* link) : link_(*link) {}

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
  // The encoded words of picture numbers in a vocabulary, likewise.
  std::map<std::uint32_t, std::vector<std::uint8_t>> Words(
      Key vocabulary, const std::vector<std::uint64_t>& pictures);

 private:
  std::vector<PictureState> Select(const std::string& where, std::uint64_t log,
                                   const std::string& then);
  std::map<std::uint32_t, std::vector<std::uint8_t>> Blobs(const std::string& statement);

  ClusterLink& link_;
};

}  // namespace pliant::clickhouse
