// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The JSON forms of records: images, vocabularies, collections.
#pragma once

#include <string>

#include "index/engine/engine.h"
#include "index/json/json.h"

namespace pliant {

// "created", "replaced" or "unchanged".
const char* OutcomeName(AddOutcome outcome);

// {"id", "collection", "object", "metadata", "source", "sha256", "media_type", "bytes", "width",
// "height", "keypoints", "added_at", "updated_at"}
Json ImageJson(const ImageRecord& image);

// {"id", "words", "active", "model_id", "method", "seed", "sampled", "available", "loss",
// "created_at"}
Json VocabularyJson(const VocabularyRecord& vocabulary);

// {"name", "images", "objects", "descriptors", "vocabulary": VocabularyJson or null, "created_at"}
Json CollectionJson(const CollectionRecord& collection);

// {"object", "images", "image_id": text or null, "created_at", "updated_at"}
Json ListedObjectJson(const ListedObject& object);

// By key: {"values": [{"value", "count"}], "without", "complete"}
Json FacetsJson(const std::vector<Facet>& facets);

// Metadata as stored, a JSON object in text; {} if it is not an object.
Json MetadataJson(const std::string& metadata);

}  // namespace pliant
