// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Rules for names and metadata.
#pragma once

#include <string>
#include <string_view>

namespace pliant {

// Throw kInvalidArgument that names the field. An id is 1..128 of letters, digits and . _ ~ : @ -,
// not "." or "..", so that it can be a part of a URL; a collection name 1..64 of letters, digits,
// . _ -; an object is at most 512 bytes of UTF-8 without control characters; a source 4096.
void CheckImageId(std::string_view id);
void CheckCollectionName(std::string_view name);
void CheckAliasName(std::string_view name);    // as a collection's name
void CheckDisplayName(std::string_view name);  // as an object, 200 bytes, or empty
void CheckObject(std::string_view object);
void CheckName(std::string_view name, const std::string& field);  // as an object
void CheckSource(std::string_view source);

// A JSON object of at most 64 KiB, 32 levels and 1000 names an object, rewritten with sorted keys
// and no white space so that equal metadata compare equal. Throws kInvalidArgument
// "metadata_invalid".
std::string CanonicalMetadata(const std::string& metadata);

// `metadata` with the JSON merge patch (RFC 7396) applied, canonical: null removes a key, objects
// are merged, all else replaces. The patch "null" leaves {}. Throws kInvalidArgument
// "metadata_invalid" for a patch that is neither an object nor null, and for a result beyond the
// limits.
std::string MergeMetadata(const std::string& metadata, const std::string& patch);

}  // namespace pliant
