// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/picture_states.h"

#include <algorithm>
#include <future>
#include <numeric>
#include <set>
#include <utility>

#include "descriptor/base/hex.h"
#include "descriptor/base/sha256.h"
#include "index/store/clickhouse/query.h"

namespace pliant::clickhouse {
namespace {

constexpr std::size_t kBlobsTogether = 512;

std::string RawBytes(const std::string& hex) {
  const auto bytes = FromHex(hex).value_or(std::vector<std::uint8_t>{});
  return {bytes.begin(), bytes.end()};
}

std::string HexOf(std::string_view bytes) {
  return ToHex({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

PictureState ToState(const Row& row) {
  PictureState state;
  state.collection = static_cast<std::uint32_t>(row.Number(0));
  state.record.id = row.Text(1);
  state.version = row.Number(2);
  state.deleted = row.Number(3) != 0;
  state.picture = static_cast<std::uint32_t>(row.Number(4));
  state.content = row.Number(5) != 0;
  ImageRecord& record = state.record;
  record.object = row.Text(6);
  record.sha256 = HexOf(row.Fixed(7));
  record.media_type = row.Text(8);
  record.width = static_cast<int>(row.Number(9));
  record.height = static_cast<int>(row.Number(10));
  record.bytes = row.Number(11);
  record.keypoints = static_cast<std::uint32_t>(row.Number(12));
  record.metadata = row.Text(13);
  record.source = row.Text(14);
  record.added_ms = row.Signed(15);
  record.updated_ms = row.Signed(16);
  return state;
}

std::string UpTo(std::uint64_t log) { return " AND version <= " + std::to_string(log); }

// 64 hex digits as a value of FixedString(32).
std::string HashList(const std::vector<std::string>& sha256) {
  std::string list;
  for (const std::string& hash : sha256) {
    list += (list.empty() ? "" : ",") + ("toFixedString(unhex(" + Literal(hash) + "), 32)");
  }
  return list;
}

}  // namespace

Key ObjectKey(const std::string& object) {
  if (object.empty()) return 0;
  const std::string hash =
      Sha256Hex({reinterpret_cast<const std::uint8_t*>(object.data()), object.size()});
  return static_cast<Key>(std::stoull(hash.substr(0, 16), nullptr, 16) >> 1 | 1);
}

void AddRow(RowWriter& rows, const PictureState& state) {
  const ImageRecord& record = state.record;
  rows.Add(state.collection, record.id, state.version, state.deleted ? 1 : 0, state.picture,
           state.content ? 1 : 0, record.object, RawBytes(record.sha256), record.media_type,
           record.width, record.height, record.bytes, record.keypoints, record.metadata,
           record.source, record.added_ms, record.updated_ms);
}

std::vector<std::size_t> PictureStates::Shards() {
  if (only_) return *only_;
  std::vector<std::size_t> all(link_.shards());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

std::vector<PictureState> PictureStates::Select(const std::vector<std::size_t>& shards,
                                                const std::string& where, std::uint64_t log,
                                                const std::string& then) {
  static const std::string columns = [] {
    std::string list;
    for (const TableColumn& column : Table("pictures").columns) {
      list += (list.empty() ? "" : ", ") + column.name;
    }
    return list;
  }();
  std::vector<PictureState> states;
  const std::string statement = "SELECT " + columns + " FROM (SELECT " + columns +
                                " FROM pictures WHERE " + where + UpTo(log) +
                                " ORDER BY version DESC LIMIT 1 BY collection, id) WHERE "
                                "deleted = 0" +
                                then;
  const auto blocks = link_.ReadEach(shards, statement, Table("pictures").columns);
  for (std::size_t of = 0; of < blocks.size(); ++of) {
    for (std::size_t i = 0; i < blocks[of].rows; ++i) {
      states.push_back(ToState(Row(blocks[of], i)));
      states.back().shard = shards[of];
    }
  }
  return states;
}

std::vector<std::size_t> PictureStates::ShardsOf(std::uint32_t collection,
                                                 const std::vector<std::string>& ids) {
  std::set<std::size_t> shards;
  for (const std::string& id : ids) shards.insert(link_.ShardOf(collection, id));
  return {shards.begin(), shards.end()};
}

std::vector<PictureState> PictureStates::ByIds(std::uint32_t collection,
                                               const std::vector<std::string>& ids,
                                               std::uint64_t log) {
  if (ids.empty()) return {};
  return Select(
      ShardsOf(collection, ids),
      "collection = " + std::to_string(collection) + " AND id IN (" + LiteralList(ids) + ")", log,
      "");
}

std::vector<PictureState> PictureStates::ByRefs(
    const std::vector<std::pair<std::uint32_t, std::string>>& refs, std::uint64_t log) {
  std::map<std::size_t, std::string> lists;  // by shard
  for (const auto& [collection, id] : refs) {
    std::string& list = lists[link_.ShardOf(collection, id)];
    list += (list.empty() ? "(" : ",(") + std::to_string(collection) + "," + Literal(id) + ")";
  }
  std::vector<std::future<std::vector<PictureState>>> parts;
  for (const auto& [shard, list] : lists) {
    parts.push_back(std::async(std::launch::async, [this, log, of = shard, &refs = list] {
      return Select({of}, "(collection, id) IN (" + refs + ")", log, "");
    }));
  }
  std::vector<PictureState> states;
  for (auto& part : parts) {
    for (PictureState& state : part.get()) states.push_back(std::move(state));
  }
  return states;
}

std::optional<PictureState> PictureStates::ById(std::uint32_t collection, const std::string& id,
                                                std::uint64_t log) {
  std::vector<PictureState> found = ByIds(collection, {id}, log);
  if (found.empty()) return std::nullopt;
  return std::move(found.front());
}

std::vector<PictureState> PictureStates::BySha256(const std::vector<std::string>& sha256,
                                                  std::uint64_t log) {
  std::vector<std::string> usable;  // an unusable hash matches nothing
  for (const std::string& hash : sha256) {
    if (RawBytes(hash).size() == 32) usable.push_back(hash);
  }
  if (usable.empty()) return {};
  const std::string list = HashList(usable);
  std::vector<PictureState> states = Select(
      Shards(),
      "(collection, id) IN (SELECT collection, id FROM by_sha256 WHERE sha256 IN (" + list + "))",
      log, " AND sha256 IN (" + list + ")");
  std::sort(states.begin(), states.end(), [](const PictureState& a, const PictureState& b) {
    return std::pair(a.collection, std::string_view(a.record.id)) <
           std::pair(b.collection, std::string_view(b.record.id));
  });
  return states;
}

std::vector<PictureOutline> PictureStates::Outlines(const OutlineQuery& query) {
  const std::string collection = std::to_string(query.collection);
  std::string where = "collection = " + collection + UpTo(query.log);
  std::string having;
  if (query.object) {
    having = " AND of_object = " + Literal(*query.object);
    if (!query.object->empty()) {
      where += " AND id IN (SELECT id FROM by_object WHERE collection = " + collection +
               " AND object = " + Literal(*query.object) + ")";
    }
  }
  const std::string statement =
      "SELECT id, v, number, of_object, of_source, of_metadata, points, added, updated FROM ("
      "SELECT id, max(version) AS v, argMax(deleted, version) AS gone, argMax(picture, version) AS "
      "number, argMax(object, version) AS of_object, argMax(source, version) AS of_source, " +
      std::string(query.metadata ? "argMax(metadata, version)" : "''") +
      " AS of_metadata, argMax(keypoints, version) AS points, argMax(added_ms, version) AS added, "
      "argMax(updated_ms, version) AS updated FROM pictures WHERE " +
      where + " GROUP BY id) WHERE gone = 0" + having + query.more + query.end;
  const std::vector<TableColumn> columns = {
      {"id", "String"},        {"v", "UInt64"},         {"number", "UInt32"},
      {"of_object", "String"}, {"of_source", "String"}, {"of_metadata", "String"},
      {"points", "UInt32"},    {"added", "Int64"},      {"updated", "Int64"}};
  std::vector<PictureOutline> outlines;
  for (const NativeBlock& block : link_.ReadEach(Shards(), statement, columns)) {
    for (std::size_t i = 0; i < block.rows; ++i) {
      const Row row(block, i);
      outlines.push_back({row.Number(1), static_cast<std::uint32_t>(row.Number(2)), row.Text(0),
                          row.Text(3), row.Text(4), row.Text(5),
                          static_cast<std::uint32_t>(row.Number(6)), row.Signed(7), row.Signed(8)});
    }
  }
  return outlines;
}

std::map<std::uint32_t, std::vector<std::uint8_t>> PictureStates::Blobs(
    const std::vector<std::size_t>& shards, const std::string& statement) {
  std::map<std::uint32_t, std::vector<std::uint8_t>> blobs;
  for (const NativeBlock& block :
       link_.ReadEach(shards, statement, {{"picture", "UInt32"}, {"data", "String"}})) {
    for (std::size_t i = 0; i < block.rows; ++i) {
      const Row row(block, i);
      const std::string& data = row.Text(1);
      blobs[static_cast<std::uint32_t>(row.Number(0))].assign(data.begin(), data.end());
    }
  }
  return blobs;
}

std::map<std::uint32_t, std::vector<std::uint8_t>> PictureStates::FeaturesOn(
    const std::vector<std::size_t>& shards, const std::vector<std::uint64_t>& pictures) {
  std::map<std::uint32_t, std::vector<std::uint8_t>> all;
  for (std::size_t from = 0; from < pictures.size(); from += kBlobsTogether) {
    const std::size_t to = std::min(pictures.size(), from + kBlobsTogether);
    const std::vector<std::uint64_t> some(pictures.begin() + static_cast<std::ptrdiff_t>(from),
                                          pictures.begin() + static_cast<std::ptrdiff_t>(to));
    all.merge(Blobs(
        shards, "SELECT picture, data FROM features WHERE picture IN (" + LiteralList(some) + ")"));
  }
  return all;
}

std::map<std::uint32_t, std::vector<std::uint8_t>> PictureStates::Features(
    const std::vector<std::uint64_t>& pictures) {
  return FeaturesOn(Shards(), pictures);
}

std::map<std::uint32_t, std::vector<std::uint8_t>> PictureStates::Features(
    const NumbersByShard& pictures) {
  using Part = std::map<std::uint32_t, std::vector<std::uint8_t>>;
  std::vector<std::future<Part>> parts;
  for (const auto& [shard, numbers] : pictures) {
    parts.push_back(std::async(std::launch::async, [this, of = shard, &some = numbers] {
      return FeaturesOn({of}, some);
    }));
  }
  Part all;
  for (auto& part : parts) all.merge(part.get());
  return all;
}

std::map<std::uint32_t, std::vector<std::uint8_t>> PictureStates::Words(
    Key vocabulary, const std::vector<std::uint64_t>& pictures) {
  if (pictures.empty()) return {};
  return Blobs(Shards(),
               "SELECT picture, data FROM words WHERE vocabulary = " + std::to_string(vocabulary) +
                   " AND picture IN (" + LiteralList(pictures) + ")");
}

}  // namespace pliant::clickhouse
