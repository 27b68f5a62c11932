// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A search's answer as an image.
#pragma once

#include <string>

#include "descriptor/image/image.h"
#include "index/records/search.h"

namespace pliant::server {

// Whether the header Accept names PNG with at least the weight of JPEG (RFC 9110, section 12.5.1).
bool PrefersPng(const std::string& accept);

// The query image as a JPEG or PNG, its longer side at most 1600 pixels, with the outlines of all
// instances of the found hits. Each hit has its own colour, its name (the object, else the file
// name, else the id) and its probability. Hits without probabilities are drawn if they have an
// outline. The label "not found" replaces missing outlines. Throws what `decode` throws.
std::string DrawSearch(Bytes query, DecodeOptions options, const ImageDecoder& decode,
                       const SearchResult& result, bool png);

}  // namespace pliant::server
