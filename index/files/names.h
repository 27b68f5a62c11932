// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What names and metadata may be.
#pragma once

#include <cstddef>
#include <limits>
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
void CheckSource(std::string_view source);

// What an earlier Pliant may have stored, which had fewer characters in mind; else the same.
void CheckStoredObject(std::string_view object);
void CheckStoredSource(std::string_view source);

// A JSON object of at most 64 KiB, 32 levels and `most_names` an object, rewritten with sorted keys
// and no white space so that equal metadata compare equal. Throws kInvalidArgument
// "metadata_invalid". An earlier Pliant may have stored metadata with any number of names.
inline constexpr std::size_t kMostMetadataNames = 1000;
inline constexpr std::size_t kAnyNumberOfNames = std::numeric_limits<std::size_t>::max();
std::string CanonicalMetadata(const std::string& metadata,
                              std::size_t most_names = kMostMetadataNames);

}  // namespace pliant
