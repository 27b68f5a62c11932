// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// ClickhouseCatalogue: collections, and the cluster as a whole.
#include <algorithm>
#include <set>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/clickhouse_catalogue.h"
#include "index/store/clickhouse/cluster.h"
#include "index/store/clickhouse/query.h"

namespace pliant::clickhouse {

std::vector<std::string> ClickhouseCatalogue::ListCollections() {
  std::vector<std::string> names;
  for (const auto& [name, entry] : snapshots_.Now().registry->collections) names.push_back(name);
  return names;
}

std::vector<CollectionLabel> ClickhouseCatalogue::ListLabels() {
  const Snapshot now = snapshots_.Now();
  std::vector<CollectionLabel> labels;
  for (const auto& [name, entry] : now.registry->collections) {
    labels.push_back({name, entry.display_name, now.registry->AliasesOf(entry.key)});
  }
  return labels;
}

std::vector<AliasRecord> ClickhouseCatalogue::ListAliases() {
  const Snapshot now = snapshots_.Now();
  std::vector<AliasRecord> aliases;
  for (const auto& [name, alias] : now.registry->aliases) {
    const CollectionEntry* collection = now.registry->Find(alias.collection);
    if (collection != nullptr) aliases.push_back({name, collection->name, alias.updated_ms});
  }
  return aliases;
}

CollectionState ClickhouseCatalogue::RequireCollection(const std::string& name) {
  const Snapshot now = snapshots_.Now();
  const CollectionEntry& entry = now.registry->Require(name);
  return {entry.key, entry.name, entry.vocabulary, entry.created_ms};
}

CollectionRecord ClickhouseCatalogue::DescribeCollection(const std::string& name) {
  const Snapshot now = snapshots_.Now();
  return Describe(now, now.registry->Require(name));
}

CollectionRecord ClickhouseCatalogue::Describe(const Snapshot& now,
                                               const CollectionEntry& collection) {
  CollectionRecord record;
  record.name = collection.name;
  record.display_name = collection.display_name;
  record.aliases = now.registry->AliasesOf(collection.key);
  record.created_ms = collection.created_ms;
  record.automatic = collection.automatic;
  const auto counts = CountAll(now);
  if (const auto count = counts->find(collection.key); count != counts->end()) {
    record.images = count->second.images;
    record.objects = count->second.objects;
    record.descriptors = count->second.descriptors;
  }
  const VocabularyEntry* active =
      now.registry->FindVocabulary(collection.key, collection.vocabulary);
  if (active != nullptr) record.vocabulary = now.registry->Describe(*active);
  return record;
}

std::shared_ptr<const ClickhouseCatalogue::Counts> ClickhouseCatalogue::CountAll(
    const Snapshot& now) {
  {
    const std::lock_guard lock(mutex_);
    if (counts_ && counted_at_ == now.log) return counts_;
  }
  const std::vector<NativeBlock> blocks = link_.ReadEach(
      "SELECT collection, of_object, count() AS images, sum(points) AS descriptors FROM (SELECT "
      "collection, id, argMax(deleted, version) AS gone, argMax(object, version) AS of_object, "
      "argMax(keypoints, version) AS points FROM pictures WHERE version <= " +
          std::to_string(now.log) +
          " GROUP BY collection, id) WHERE gone = 0 GROUP BY collection, of_object",
      {{"collection", "UInt32"},
       {"of_object", "String"},
       {"images", "UInt64"},
       {"descriptors", "UInt64"}});
  auto counts = std::make_shared<Counts>();
  std::map<std::uint32_t, std::set<std::string>> objects;  // one may be on several shards
  for (const NativeBlock& block : blocks) {
    for (std::size_t i = 0; i < block.rows; ++i) {
      const Row row(block, i);
      const auto collection = static_cast<std::uint32_t>(row.Number(0));
      if (!row.Text(1).empty()) objects[collection].insert(row.Text(1));
      (*counts)[collection].images += row.Number(2);
      (*counts)[collection].descriptors += row.Number(3);
    }
  }
  for (const auto& [collection, names] : objects) (*counts)[collection].objects = names.size();
  const std::lock_guard lock(mutex_);
  counted_at_ = now.log;
  counts_ = counts;
  return counts;
}

EngineStats ClickhouseCatalogue::Count() {
  const Snapshot now = snapshots_.Now();
  EngineStats stats;
  const auto counts = CountAll(now);
  for (const auto& [name, collection] : now.registry->collections) {
    const auto count = counts->find(collection.key);
    if (count == counts->end()) continue;
    stats.images += count->second.images;
    stats.objects += count->second.objects;
    stats.descriptors += count->second.descriptors;
  }
  const std::string size =
      "SELECT toUInt64(sum(bytes_on_disk)) AS bytes FROM system.parts WHERE active AND database "
      "= " +
      Literal(link_.url().database);
  for (const NativeBlock& block : link_.ReadEach(size, {{"bytes", "UInt64"}})) {
    if (block.rows > 0) stats.database_bytes += Row(block, 0).Number(0);
  }
  if (now.registry->model) {
    stats.descriptor = now.registry->model->info.name;
    stats.model_id = now.registry->model->info.model_id;
  }
  if (const CollectionEntry* entry = now.registry->Find(std::string(kDefaultCollection))) {
    const VocabularyEntry* active = now.registry->FindVocabulary(entry->key, entry->vocabulary);
    if (active != nullptr) stats.vocabulary = now.registry->Describe(*active);
  }
  return stats;
}

void ClickhouseCatalogue::CheckPictures(const Snapshot& now, std::vector<std::string>& problems) {
  const auto lacking = [&](const CollectionEntry& collection, const std::string& table,
                           const std::string& where) {
    OutlineQuery query{.collection = collection.key, .log = now.log};
    query.more = " AND number NOT IN (SELECT picture FROM " + table + where + ")";
    return states_.Outlines(query).size();
  };
  for (const auto& [name, collection] : now.registry->collections) {
    if (const std::size_t count = lacking(collection, "features", "")) {
      problems.push_back(std::to_string(count) + " pictures of collection \"" + name +
                         "\" have lost their features");
    }
    if (collection.vocabulary == 0) continue;
    const std::string of = " WHERE vocabulary = " + std::to_string(collection.vocabulary);
    if (const std::size_t count = lacking(collection, "words", of)) {
      problems.push_back(std::to_string(count) + " pictures of collection \"" + name +
                         "\" have no words of the active vocabulary");
    }
    try {
      clickhouse::ClickhouseCatalogue::ReadVocabulary(collection.vocabulary);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kCorrupt) throw;
      problems.emplace_back(error.what());
    }
  }
}

std::vector<std::string> ClickhouseCatalogue::Check() {
  std::vector<std::string> problems = FindProblems(Cluster(link_.url(), password_).Read());
  CheckPictures(snapshots_.Now(), problems);
  return problems;
}

void ClickhouseCatalogue::Backup(const std::filesystem::path& /*target*/,
                                 const std::stop_token& /*stop*/) {
  throw Error(ErrorCode::kInvalidArgument, "backup_unsupported",
              "a cluster is not backed up into one file; use ClickHouse's own backups");
}

}  // namespace pliant::clickhouse
