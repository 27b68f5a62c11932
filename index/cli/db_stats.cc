// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/db_stats.h"

#include <utility>
#include <vector>

#include "descriptor/base/format_bytes.h"
#include "index/cli/db_check.h"
#include "index/cli/output.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

// Sizes, descriptor and model are those of the database.
void Narrow(EngineStats& stats, const CollectionRecord& collection) {
  stats.images = collection.images;
  stats.objects = collection.objects;
  stats.descriptors = collection.descriptors;
  stats.vocabulary = collection.vocabulary;
}

std::vector<CollectionRecord> Collections(Engine& engine) {
  std::vector<CollectionRecord> collections;
  for (const std::string& name : engine.ListCollections()) {
    try {
      collections.push_back(engine.GetCollection(name));
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;  // removed meanwhile
    }
  }
  return collections;
}

Json StatsJson(const EngineStats& stats, const std::optional<OriginalsRecord>& originals) {
  return {{"images", stats.images},
          {"objects", stats.objects},
          {"descriptors", stats.descriptors},
          {"database_bytes", stats.database_bytes},
          {"index_bytes", stats.index_bytes},
          {"descriptor", stats.descriptor},
          {"model_id", stats.model_id},
          {"originals", OriginalsJson(originals)},
          {"vocabulary", stats.vocabulary ? VocabularyDocument(*stats.vocabulary) : Json(nullptr)}};
}

void PrintStats(const EngineStats& stats, const std::optional<OriginalsRecord>& originals) {
  Print("images       " + std::to_string(stats.images));
  Print("objects      " + std::to_string(stats.objects));
  Print("descriptors  " + std::to_string(stats.descriptors));
  Print("on disk      " + FormatBytes(stats.database_bytes));
  Print("in memory    " + FormatBytes(stats.index_bytes));
  if (originals) {
    Print("originals    " + std::to_string(originals->files) + " files in " +
          originals->directory.string());
  }
  Print("descriptor   " + stats.descriptor + " (" + stats.model_id + ")");
  Print("vocabulary   " + (stats.vocabulary ? std::to_string(stats.vocabulary->id) + " of " +
                                                  std::to_string(stats.vocabulary->words) + " words"
                                            : std::string("none yet")));
}

void PrintCollections(const std::vector<CollectionRecord>& collections) {
  std::string lead = "collections  ";
  for (const CollectionRecord& c : collections) {
    Print(std::exchange(lead, std::string(lead.size(), ' ')) + ToDisplayText(c.name) + ": " +
          std::to_string(c.images) + (c.images == 1 ? " image" : " images"));
  }
}

}  // namespace

Json OriginalsJson(const std::optional<OriginalsRecord>& originals) {
  if (!originals) return nullptr;
  return {{"directory", ToDisplayText(originals->directory.string())},
          {"files", originals->files},
          {"owned", originals->owned}};
}

ExitStatus RunStats(EngineOptions& opened, const StatsOptions& options) {
  Engine engine = OpenForCare(opened, Access::kRead, true);
  EngineStats stats = engine.Stats();
  const auto originals = engine.DescribeOriginals();
  std::vector<CollectionRecord> collections;
  if (options.collection.empty()) {
    collections = Collections(engine);
  } else {
    Narrow(stats, engine.GetCollection(options.collection));
  }
  if (!options.json) {
    PrintStats(stats, originals);
    PrintCollections(collections);
    return ExitStatus::kDone;
  }
  Json json = StatsJson(stats, originals);
  if (options.collection.empty()) {
    Json list = Json::array();
    for (const CollectionRecord& c : collections) {
      list.push_back({{"name", ToDisplayText(c.name)}, {"images", c.images}});
    }
    json["collections"] = std::move(list);
  } else {
    json["collection"] = ToDisplayText(options.collection);
  }
  PrintJson(json);
  return ExitStatus::kDone;
}

}  // namespace pliant::cli
