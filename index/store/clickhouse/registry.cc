// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/registry.h"

#include <chrono>

#include <nlohmann/json.hpp>

#include "descriptor/base/error.h"
#include "index/files/text.h"
#include "index/store/clickhouse/registry_text.h"
#include "index/store/refusals.h"

namespace pliant::clickhouse {
namespace {

using Json = nlohmann::json;

constexpr const char* kModel = "model";
constexpr const char* kCollection = "collection";
constexpr const char* kAlias = "alias";
constexpr const char* kVocabulary = "vocabulary";

StoredModel ReadModel(const Json& body) {
  StoredModel model;
  model.info.name = body.at("name").get<std::string>();
  model.info.kind = static_cast<DescriptorKind>(body.at("kind").get<int>());
  model.info.dim = body.at("dim").get<int>();
  model.info.model_id = body.at("model_id").get<std::string>();
  model.limits.max_keypoints = body.at("max_keypoints").get<int>();
  model.limits.max_side_px = body.at("max_side").get<int>();
  return model;
}

CollectionEntry ReadCollection(const std::string& name, const Json& body) {
  CollectionEntry entry;
  entry.name = name;
  entry.key = body.at("key").get<std::uint32_t>();
  entry.display_name = body.at("display_name").get<std::string>();
  entry.created_ms = body.at("created_ms").get<std::int64_t>();
  entry.vocabulary = body.at("vocabulary").get<Key>();
  entry.automatic = body.at("automatic").get<bool>();
  return entry;
}

AliasEntry ReadAlias(const std::string& name, const Json& body) {
  return {name, body.at("collection").get<std::uint32_t>(),
          body.at("updated_ms").get<std::int64_t>()};
}

VocabularyEntry ReadVocabularyEntry(const Json& body) {
  VocabularyEntry entry;
  entry.key = body.at("key").get<Key>();
  entry.collection = body.at("collection").get<std::uint32_t>();
  entry.words = body.at("words").get<std::size_t>();
  entry.origin = {body.at("seed").get<std::uint64_t>(), body.at("sampled").get<std::uint64_t>(),
                  body.at("available").get<std::uint64_t>(), body.at("loss").get<double>(),
                  body.at("method").get<std::string>()};
  entry.checksum = body.at("checksum").get<std::uint32_t>();
  entry.created_ms = body.at("created_ms").get<std::int64_t>();
  entry.ready = body.at("ready").get<bool>();
  return entry;
}

template <typename Map, typename Name, typename Read>
void Put(Map& map, const Name& name, bool deleted, const Read& read) {
  if (deleted) {
    map.erase(name);
  } else {
    map.insert_or_assign(name, read());
  }
}

}  // namespace

std::int64_t NowMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

const CollectionEntry* Registry::Find(const std::string& name) const {
  if (const auto found = collections.find(name); found != collections.end()) return &found->second;
  const auto alias = aliases.find(name);
  return alias == aliases.end() ? nullptr : Find(alias->second.collection);
}

const CollectionEntry* Registry::Find(std::uint32_t key) const {
  for (const auto& [name, entry] : collections) {
    if (entry.key == key) return &entry;
  }
  return nullptr;
}

const CollectionEntry& Registry::Require(const std::string& name) const {
  if (const CollectionEntry* found = Find(name)) return *found;
  throw refusals::NoCollection(name);
}

const VocabularyEntry* Registry::FindVocabulary(std::uint32_t collection, Key vocabulary) const {
  const auto found = vocabularies.find(vocabulary);
  const bool fits =
      found != vocabularies.end() && found->second.ready && found->second.collection == collection;
  return fits ? &found->second : nullptr;
}

VocabularyRecord Registry::Describe(const VocabularyEntry& vocabulary) const {
  VocabularyRecord record;
  const CollectionEntry* collection = Find(vocabulary.collection);
  record.id = vocabulary.key;
  if (collection != nullptr) record.collection = collection->name;
  if (model) record.model_id = model->info.model_id;
  record.words = vocabulary.words;
  record.origin = vocabulary.origin;
  record.created_ms = vocabulary.created_ms;
  record.active = collection != nullptr && collection->vocabulary == vocabulary.key;
  return record;
}

std::vector<std::string> Registry::AliasesOf(std::uint32_t collection) const {
  std::vector<std::string> names;
  for (const auto& [name, alias] : aliases) {
    if (alias.collection == collection) names.push_back(name);
  }
  return names;
}

bool IsCommon(const RegistryRow& row) {
  return row.kind == kModel || row.kind == kCollection || row.kind == kAlias ||
         row.kind == kVocabulary || row.kind == kPurgeKind;
}

RegistryRow ToRow(const StoredModel& model) {
  return {kModel, kModel, false,
          RegistryText({{"name", model.info.name},
                        {"kind", static_cast<int>(model.info.kind)},
                        {"dim", model.info.dim},
                        {"model_id", model.info.model_id},
                        {"max_keypoints", model.limits.max_keypoints},
                        {"max_side", model.limits.max_side_px}})};
}

RegistryRow ToRow(const CollectionEntry& collection, bool deleted) {
  return {kCollection, collection.name, deleted,
          RegistryText({{"key", collection.key},
                        {"display_name", collection.display_name},
                        {"created_ms", collection.created_ms},
                        {"vocabulary", collection.vocabulary},
                        {"automatic", collection.automatic}})};
}

RegistryRow ToRow(const AliasEntry& alias, bool deleted) {
  return {kAlias, alias.name, deleted,
          RegistryText({{"collection", alias.collection}, {"updated_ms", alias.updated_ms}})};
}

RegistryRow ToRow(const VocabularyEntry& vocabulary, bool deleted) {
  const VocabularyOrigin& origin = vocabulary.origin;
  return {kVocabulary, std::to_string(vocabulary.key), deleted,
          RegistryText({{"key", vocabulary.key},
                        {"collection", vocabulary.collection},
                        {"words", vocabulary.words},
                        {"seed", origin.seed},
                        {"sampled", origin.sampled},
                        {"available", origin.available},
                        {"loss", origin.loss},
                        {"method", origin.method},
                        {"checksum", vocabulary.checksum},
                        {"created_ms", vocabulary.created_ms},
                        {"ready", vocabulary.ready}})};
}

RegistryRow ToRow(const PurgeEntry& purge) {
  return {kPurgeKind, kPurgeKind, false,
          RegistryText({{"states", purge.states}, {"log", purge.log}})};
}

void Apply(const RegistryRow& row, Registry& registry) {
  if (!IsCommon(row)) return;  // its body may be anything: a job's input is what a client sent
  try {
    const Json body = Json::parse(row.body);
    if (row.kind == kModel) registry.model = ReadModel(body);
    if (row.kind == kCollection) {
      Put(registry.collections, row.name, row.deleted,
          [&] { return ReadCollection(row.name, body); });
    }
    if (row.kind == kPurgeKind) {
      registry.purge = {body.at("states").get<std::uint64_t>(),
                        body.at("log").get<std::uint64_t>()};
    }
    if (row.kind == kAlias) {
      Put(registry.aliases, row.name, row.deleted, [&] { return ReadAlias(row.name, body); });
    }
    if (row.kind == kVocabulary) {
      Put(registry.vocabularies, body.at("key").get<Key>(), row.deleted,
          [&] { return ReadVocabularyEntry(body); });
    }
  } catch (const Json::exception& error) {
    throw Error(ErrorCode::kCorrupt, "registry_corrupt",
                "the cluster's entry of " + ToDisplayText(row.kind) + " " +
                    ToDisplayText(row.name) + " cannot be read: " + error.what());
  }
}

}  // namespace pliant::clickhouse
