// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/statements.h"

namespace pliant::clickhouse {
namespace {

// Words from here on are no words: 0xFFFFFF00 + epoch is the word of a picture's norm.
constexpr const char* kFirstNormWord = "4294967040";

std::string Path(const DatabaseUrl& url, const TableSpec& table) {
  const std::string shard = table.placement == Placement::kShard ? "{shard}" : "all";
  return "'/clickhouse/tables/" + shard + "/" + url.database + "/" + table.name + "','{replica}'";
}

std::string Engine(const DatabaseUrl& url, const TableSpec& table) {
  std::string engine = table.replacing ? "ReplicatedReplacingMergeTree(" : "ReplicatedMergeTree(";
  engine += Path(url, table);
  if (!table.version.empty()) engine += ", " + table.version;
  return engine + ")";
}

// What ranks. Both hold (vocabulary, word, picture), so a word's list is one range of the key.
std::vector<TableSpec> RankingTables() {
  return {
      // For `tfidf`: a row per word of a picture, with the signature of its descriptors there. A
      // picture's norm is a row too, so that it comes with the same scan; norms have partitions of
      // their own, so that an old epoch is dropped in an instant. The first bits of the signature
      // are in the key: a query may read only the rows whose first bits are near its own.
      {.name = "postings",
       .columns = {{"vocabulary", "UInt32"},
                   {"word", "UInt32"},
                   {"picture", "UInt32"},
                   {"signature", "UInt64"}},
       .partition = std::string("(vocabulary, if(word < ") + kFirstNormWord + ", 0, word))",
       .order = "(word, bitShiftRight(signature, 58), picture)",
       .granularity = 1024},
      // For `neighbours`: a row per descriptor x, because its votes are for descriptors and not for
      // words: max(0, a |q - w|^2 - |q - x|^2), the best per query descriptor q and picture.
      // |q - x|^2 = |q - w|^2 + b - 2 (R q).c comes from the code c and its bias b alone
      // (vocab/residual_codes.h), so that no descriptor is read. A signature stands for all
      // descriptors of a picture in a word and cannot replace them; the two tables are filled by
      // one upload, and which is read depends on the ranking.
      {.name = "codes",
       .columns = {{"vocabulary", "UInt32"},
                   {"word", "UInt32"},
                   {"picture", "UInt32"},
                   {"code", "FixedString(32)"},
                   {"bias", "Int16"}},
       .partition = "vocabulary",
       .order = "(word, picture)",
       .granularity = 1024},
      // Who a picture number is. `keypoints`: the sum of votes is divided by its square root.
      {.name = "heads",
       .columns = {{"picture", "UInt32"},
                   {"collection", "UInt32"},
                   {"id", "String"},
                   {"version", "UInt64"},
                   {"sha256", "FixedString(32)"},
                   {"keypoints", "UInt32"}},
       .order = "picture",
       .granularity = 256},
      {.name = "features",
       .columns = {{"picture", "UInt32"}, {"model", "UInt32"}, {"data", "String"}},
       .order = "picture",
       .granularity = 1},
  };
}

// The record is the truth: a picture is there when its row is, and gone when a later one says so.
std::vector<TableSpec> RecordTables() {
  return {
      {.name = "pictures",
       .columns = {{"collection", "UInt32"},
                   {"id", "String"},
                   {"version", "UInt64"},
                   {"deleted", "UInt8"},
                   {"picture", "UInt32"},
                   {"object", "String"},
                   {"sha256", "FixedString(32)"},
                   {"media_type", "String"},
                   {"width", "UInt32"},
                   {"height", "UInt32"},
                   {"bytes", "UInt64"},
                   {"keypoints", "UInt32"},
                   {"metadata", "String"},
                   {"meta_key", "Array(String)"},
                   {"meta_kind", "Array(UInt8)"},
                   {"meta_text", "Array(String)"},
                   {"meta_number", "Array(Float64)"},
                   {"source", "String"},
                   {"added_ms", "Int64"}},
       .replacing = true,
       .version = "version",
       .order = "(collection, id)",
       .granularity = 256},
      {.name = "by_sha256",
       .columns = {{"sha256", "FixedString(32)"}, {"collection", "UInt32"}, {"id", "String"}},
       .replacing = true,
       .order = "(sha256, collection, id)",
       .granularity = 256},
      {.name = "by_object",
       .columns = {{"collection", "UInt32"}, {"object", "String"}, {"id", "String"}},
       .replacing = true,
       .order = "(collection, object, id)",
       .granularity = 256},
      {.name = "originals",
       .columns = {{"sha256", "FixedString(32)"}, {"data", "String"}},
       .replacing = true,
       .order = "sha256",
       .granularity = 1},
  };
}

std::vector<TableSpec> CommonTables() {
  return {
      // Collections, keys, vocabularies, jobs, settings: little, and needed everywhere.
      {.name = "registry",
       .placement = Placement::kEverywhere,
       .columns = {{"kind", "String"},
                   {"name", "String"},
                   {"version", "UInt64"},
                   {"deleted", "UInt8"},
                   {"body", "String"}},
       .replacing = true,
       .version = "version",
       .order = "(kind, name)",
       .granularity = 64},
      {.name = "vocabulary_words",
       .placement = Placement::kEverywhere,
       .columns = {{"vocabulary", "UInt32"},
                   {"word", "UInt32"},
                   {"data", "String"},
                   {"thresholds", "String"}},
       .partition = "vocabulary",
       .order = "word",
       .granularity = 64},
      {.name = "statistics",
       .placement = Placement::kEverywhere,
       .columns =
           {{"vocabulary", "UInt32"}, {"epoch", "UInt32"}, {"word", "UInt32"}, {"df", "UInt64"}},
       .partition = "vocabulary",
       .order = "(epoch, word)",
       .granularity = 1024},
  };
}

}  // namespace

const std::vector<TableSpec>& Tables() {
  static const std::vector<TableSpec> tables = [] {
    std::vector<TableSpec> all;
    for (const auto& room : {RankingTables(), RecordTables(), CommonTables()}) {
      all.insert(all.end(), room.begin(), room.end());
    }
    return all;
  }();
  return tables;
}

std::string ReadingName(const TableSpec& table) { return "all_" + table.name; }

bool HasReading(const TableSpec& table) { return table.placement == Placement::kShard; }

std::string CreateDatabase(const DatabaseUrl& url) {
  return "CREATE DATABASE IF NOT EXISTS " + url.database + " ON CLUSTER " + url.cluster;
}

std::string CreateTable(const DatabaseUrl& url, const TableSpec& table, const Dialect& dialect) {
  std::string columns;
  for (const TableColumn& column : table.columns) {
    columns += (columns.empty() ? "" : ", ") + column.name + " " + column.type;
  }
  std::string text = "CREATE TABLE IF NOT EXISTS " + url.database + "." + table.name +
                     " ON CLUSTER " + url.cluster + " (" + columns +
                     ") ENGINE = " + Engine(url, table);
  if (!table.partition.empty()) text += " PARTITION BY " + table.partition;
  text += " ORDER BY " + table.order +
          " SETTINGS index_granularity = " + std::to_string(table.granularity);
  return text + dialect.more_table_settings;
}

std::string CreateReading(const DatabaseUrl& url, const TableSpec& table) {
  return "CREATE TABLE IF NOT EXISTS " + url.database + "." + ReadingName(table) + " ON CLUSTER " +
         url.cluster + " AS " + url.database + "." + table.name + " ENGINE = Distributed(" +
         url.cluster + ", " + url.database + ", " + table.name + ")";
}

Settings FixedSettings(std::size_t replicas) {
  Settings settings = {
      // Acknowledged is what so many replicas have: with two, both, and any may answer.
      {"insert_quorum", replicas < 2 ? "0" : "2"},
      // A replica that lags does not answer in place of one that does not.
      {"fallback_to_stale_replicas_for_distributed_queries", "0"},
      {"max_replica_delay_for_distributed_queries", "1"},
      // A shard without any replica is an error, never half an answer.
      {"skip_unavailable_shards", "0"}};
  // With three, the third may lack what the quorum has.
  if (replicas > 2) settings.emplace_back("select_sequential_consistency", "1");
  return settings;
}

std::string FixedSettingsText(std::size_t replicas) {
  std::string text = "{\"schema\":1,\"replicas\":" + std::to_string(replicas);
  for (const auto& [name, value] : FixedSettings(replicas)) text += ",\"" + name + "\":" + value;
  return text + "}";
}

}  // namespace pliant::clickhouse
