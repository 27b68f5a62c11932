// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/json/record_json.h"

namespace pliant {

const char* OutcomeName(AddOutcome outcome) {
  switch (outcome) {
    case AddOutcome::kCreated:
      return "created";
    case AddOutcome::kReplaced:
      return "replaced";
    case AddOutcome::kUnchanged:
      return "unchanged";
  }
  return "unchanged";
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
          {"added_at", IsoTime(image.added_ms)}};
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
          {"images", collection.images},
          {"objects", collection.objects},
          {"descriptors", collection.descriptors},
          {"vocabulary",
           collection.vocabulary ? VocabularyJson(*collection.vocabulary) : Json(nullptr)},
          {"created_at", IsoTime(collection.created_ms)}};
}

Json MetadataJson(const std::string& metadata) {
  Json json = Json::parse(metadata, nullptr, /*allow_exceptions=*/false);
  return json.is_object() ? json : Json::object();
}

}  // namespace pliant
