// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The JSON forms of records: images, vocabularies, collections. server/openapi/schemas.cc documents
// the fields.
#pragma once

#include <string>

#include "index/engine/engine.h"
#include "index/json/json.h"

namespace pliant {

// "created", "replaced" or "unchanged".
const char* OutcomeName(AddOutcome outcome);

Json ImageJson(const ImageRecord& image);
Json VocabularyJson(const VocabularyRecord& vocabulary);
Json CollectionJson(const CollectionRecord& collection);
Json ListedObjectJson(const ListedObject& object);
// By key.
Json FacetsJson(const std::vector<Facet>& facets);

// Metadata as stored, a JSON object in text; {} if it is not an object.
Json MetadataJson(const std::string& metadata);

}  // namespace pliant
