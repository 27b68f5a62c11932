// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is common to all shards and little: the model, collections, aliases, vocabularies. Rows of
// the table `registry`, whose bodies are JSON.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "index/store/catalogue.h"

namespace pliant::clickhouse {

struct CollectionEntry {
  std::uint32_t key = 0;
  std::string name;
  std::string display_name;
  std::int64_t created_ms = 0;
  Key vocabulary = 0;  // the active one
  bool automatic = false;
};

struct AliasEntry {
  std::string name;
  std::uint32_t collection = 0;
  std::int64_t updated_ms = 0;
};

struct VocabularyEntry {
  Key key = 0;
  std::uint32_t collection = 0;
  std::size_t words = 0;
  VocabularyOrigin origin;
  std::uint32_t checksum = 0;
  std::int64_t created_ms = 0;
  bool ready = false;
};

std::int64_t NowMs();  // Unix time

// What may be removed, as soon as nobody reads what was before this was written (cluster_purge.h).
struct PurgeEntry {
  std::uint64_t states = 0;  // those that had been replaced at this version
  std::uint64_t log = 0;     // the log up to this version
};

struct RegistryRow {
  std::string kind;
  std::string name;
  bool deleted = false;
  std::string body;
};

// The kinds of rows that are read here, for IN. Others (jobs, keys) change all the time, and change
// nothing here.
inline constexpr const char* kCommonKinds =
    "('model', 'collection', 'alias', 'vocabulary', 'purge')";
inline constexpr const char* kPurgeKind = "purge";
bool IsCommon(const RegistryRow& row);

// As of one moment. Plain values.
struct Registry {
  std::uint64_t version = 0;  // of a commit; what it has changed, and all before it, is in it
  std::optional<StoredModel> model;
  std::map<std::string, CollectionEntry> collections;  // by name
  std::map<std::string, AliasEntry> aliases;           // by name
  std::map<Key, VocabularyEntry> vocabularies;
  PurgeEntry purge;

  // By name or alias.
  const CollectionEntry* Find(const std::string& name) const;
  const CollectionEntry* Find(std::uint32_t key) const;
  // kNotFound "collection_not_found".
  const CollectionEntry& Require(const std::string& name) const;
  // Of the collection and ready; nullptr = there is none.
  const VocabularyEntry* FindVocabulary(std::uint32_t collection, Key vocabulary) const;
  VocabularyRecord Describe(const VocabularyEntry& vocabulary) const;
  std::vector<std::string> AliasesOf(std::uint32_t collection) const;
};

RegistryRow ToRow(const StoredModel& model);
RegistryRow ToRow(const CollectionEntry& collection, bool deleted = false);
RegistryRow ToRow(const AliasEntry& alias, bool deleted = false);
RegistryRow ToRow(const VocabularyEntry& vocabulary, bool deleted = false);
RegistryRow ToRow(const PurgeEntry& purge);

// Rows of other kinds are left out. Throws kCorrupt "registry_corrupt".
void Apply(const RegistryRow& row, Registry& registry);

}  // namespace pliant::clickhouse
