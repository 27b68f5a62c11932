// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A search's answer as an image.
#pragma once

#include <string>

#include "descriptor/image/image.h"
#include "index/records/search.h"

namespace pliant::server {

// Whether the header Accept names PNG and gives it no less weight than JPEG (RFC 9110, section
// 12.5.1).
bool PrefersPng(const std::string& accept);

// The query image, its longer side at most 1600 pixels, with the outlines of all instances of the
// hits that are found, each in its own colour with its object's name (or its file's, or its id) and
// probability. Hits without probabilities are drawn where they have an outline. With nothing to
// draw it says "not found". A JPEG, or a PNG. Throws what `decode` throws.
std::string DrawSearch(Bytes query, DecodeOptions options, const ImageDecoder& decode,
                       const SearchResult& result, bool png);

}  // namespace pliant::server
