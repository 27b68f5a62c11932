// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/json/record_json.h"

#include <type_traits>
#include <utility>
#include <variant>

namespace pliant {

namespace {

Json FilterValueJson(const FilterValue& value) {
  return std::visit(
      [](const auto& one) -> Json {
        if constexpr (std::is_same_v<std::decay_t<decltype(one)>, std::monostate>) {
          return nullptr;
        } else {
          return one;
        }
      },
      value);
}

}  // namespace

const char* OutcomeName(AddOutcome outcome) {
  if (outcome == AddOutcome::kCreated) return "created";
  return outcome == AddOutcome::kReplaced ? "replaced" : "unchanged";
}

Json ImageJson(const ImageRecord& image) {
  return {{"id", image.id},
          {"collection", image.collection},
          {"object", image.object},
          {"metadata", MetadataJson(image.metadata)},
          {"source", image.source},
          {"sha256", image.sha256},
          {"media_type", image.media_type},
          {"bytes", image.bytes},
          {"width", image.width},
          {"height", image.height},
          {"keypoints", image.keypoints},
          {"added_at", IsoTime(image.added_ms)},
          {"updated_at", IsoTime(image.updated_ms)}};
}

Json VocabularyJson(const VocabularyRecord& vocabulary) {
  return {{"id", vocabulary.id},
          {"words", vocabulary.words},
          {"active", vocabulary.active},
          {"model_id", vocabulary.model_id},
          {"method", vocabulary.origin.method},
          {"seed", vocabulary.origin.seed},
          {"sampled", vocabulary.origin.sampled},
          {"available", vocabulary.origin.available},
          {"loss", vocabulary.origin.loss},
          {"created_at", IsoTime(vocabulary.created_ms)}};
}

Json CollectionJson(const CollectionRecord& collection) {
  return {{"name", collection.name},
          {"display_name", TextOrNull(collection.display_name)},
          {"aliases", collection.aliases},
          {"images", collection.images},
          {"objects", collection.objects},
          {"descriptors", collection.descriptors},
          {"vocabulary",
           collection.vocabulary ? VocabularyJson(*collection.vocabulary) : Json(nullptr)},
          {"found_from", collection.found_from},
          {"created_at", IsoTime(collection.created_ms)}};
}

Json ListedObjectJson(const ListedObject& object) {
  return {{"object", object.record.object},
          {"images", object.record.images},
          {"image_id", TextOrNull(object.image_id)},
          {"created_at", IsoTime(object.created_ms)},
          {"updated_at", IsoTime(object.updated_ms)}};
}

Json FacetsJson(const std::vector<Facet>& facets) {
  Json json = Json::object();
  for (const Facet& facet : facets) {
    Json values = Json::array();
    for (const Facet::Value& value : facet.values) {
      values.push_back({{"value", FilterValueJson(value.value)}, {"count", value.count}});
    }
    json[facet.key] = {
        {"values", std::move(values)}, {"without", facet.without}, {"complete", facet.complete}};
  }
  return json;
}

Json MetadataJson(const std::string& metadata) {
  Json json = Json::parse(metadata, nullptr, /*allow_exceptions=*/false);
  return json.is_object() ? json : Json::object();
}

}  // namespace pliant
