// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/purge_lists.h"

#include "index/store/clickhouse/rows.h"

namespace pliant::clickhouse {
namespace {

std::string List(const std::vector<std::uint64_t>& keys) {
  std::string text = "0";  // no key
  for (const std::uint64_t key : keys) text += "," + std::to_string(key);
  return text;
}

std::string UpTo(std::uint64_t version) { return "version <= " + std::to_string(version); }

std::string NewestOf(const char* table, const char* name, const MayGo& may) {
  return std::string("(SELECT max(version) FROM ") + table + " WHERE " + UpTo(may.limits.states) +
         " GROUP BY " + name + ")";
}

// States that somebody may read: the one that was there at the limit, and all newer ones.
std::string Readable(const MayGo& may) {
  return "(version > " + std::to_string(may.limits.states) + " OR (deleted = 0 AND version IN " +
         NewestOf("pictures", "collection, id", may) + ")) AND NOT (" + GoneCollections(may) + ")";
}

std::string Replaced(const char* table, const char* name, const MayGo& may) {
  return std::string("SELECT DISTINCT toString(version) AS value FROM ") + table + " WHERE " +
         UpTo(may.limits.states) + " AND version NOT IN " + NewestOf(table, name, may);
}

std::string Last(const char* table, const char* name, const std::string& where, const MayGo& may) {
  return std::string(
             "SELECT toString(newest) AS value FROM (SELECT max(version) AS newest, "
             "uniqExact(version) AS states, max(deleted) AS gone FROM ") +
         table + where + " GROUP BY " + name +
         ") WHERE states = 1 AND gone = 1 AND newest <= " + std::to_string(may.limits.states);
}

std::string Literals(const std::string& of, bool is_text) {
  return is_text ? "concat('\\'', " + of + ", '\\'')" : "toString(" + of + ")";
}

}  // namespace

std::vector<std::string> ListOf(const NativeBlock& rows) {
  std::vector<std::string> values;
  for (std::size_t i = 0; i < rows.rows; ++i) values.push_back(Row(rows, i).Text(0));
  return values;
}

std::vector<std::string> ReadList(ClusterLink& link, std::size_t shard,
                                  const std::string& statement) {
  return ListOf(link.Read(shard, statement, {{"value", "String"}}));
}

std::string Joined(std::span<const std::string> values) {
  std::string text;
  for (const std::string& value : values) text += (text.empty() ? "" : ",") + value;
  return text;
}

std::string GoneCollections(const MayGo& may) {
  return "collection < " + std::to_string(may.keys_below) + " AND collection NOT IN (" +
         List(may.collections) + ")";
}

std::string GoneVocabularies(const MayGo& may, const std::string& table) {
  return "SELECT DISTINCT toString(vocabulary) AS value FROM " + table + " WHERE vocabulary < " +
         std::to_string(may.keys_below) + " AND vocabulary NOT IN (" + List(may.vocabularies) + ")";
}

std::string ReplacedStates(const MayGo& may) { return Replaced("pictures", "collection, id", may); }

std::string LastRemovals(const MayGo& may) { return Last("pictures", "collection, id", "", may); }

std::string ReplacedEntries(const MayGo& may) { return Replaced("registry", "kind, name", may); }

// Keys that were given to collections and vocabularies are found here when the Keeper has lost its
// counter (ClusterCommits).
std::string LastRemovedEntries(const MayGo& may) {
  return Last("registry", "kind, name", " WHERE kind NOT IN ('collection', 'vocabulary')", may);
}

std::string Unused::List(const MayGo& may) const {
  return "SELECT " + Literals("k", is_text) + " AS value FROM (SELECT DISTINCT " + key +
         " AS k FROM " + table + " WHERE " + key + " NOT IN (SELECT " + key +
         " FROM pictures WHERE " + Readable(may) + more + "))";
}

std::string Unused::NewerOf(const MayGo& may, const std::string& values) const {
  return "SELECT " + Literals("k", is_text) + " AS value FROM (SELECT DISTINCT " + key +
         " AS k FROM pictures WHERE version > " + std::to_string(may.limits.states) + " AND " +
         key + " IN (" + values + "))";
}

// Names are long, and written by others: such rows are named by a hash of theirs.
std::vector<Unused> UnusedRows() {
  return {{.table = "features", .key = "picture"},
          {.table = "words", .key = "picture"},
          {.table = "originals", .key = "hex(sha256)", .is_text = true, .more = " AND content = 1"},
          {.table = "by_sha256",
           .key = "hex(SHA256(concat(hex(sha256), '/', toString(collection), '/', id)))",
           .is_text = true},
          {.table = "by_object",
           .key = "hex(SHA256(concat(toString(collection), '/', object, '\\0', id)))",
           .is_text = true}};
}

}  // namespace pliant::clickhouse
