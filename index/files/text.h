// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Validation of names and metadata.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace pliant {

bool IsValidUtf8(std::string_view text);

// `text` with control characters and invalid UTF-8 bytes escaped as \xHH, and characters that are
// invisible or change the direction of writing as \u{H...}, for display, JSON and names derived
// from file names.
std::string ToDisplayText(std::string_view text);

// The display text of a name for a message: of a longer one the first bytes, and "...".
inline constexpr std::size_t kMostShownBytes = 512;  // an object's name
std::string Shown(std::string_view name, std::size_t most_bytes = kMostShownBytes);

// RFC 3986, 2.1: every byte but letters, digits and those in `kept` as %HH.
std::string PercentEncode(std::string_view text, std::string_view kept);

// Hex digits of the system's random numbers, for names that nobody else has.
std::string RandomHex(std::size_t digits);

// Throw kInvalidArgument that names the field. An id is 1..128 of letters, digits and . _ ~ : @ -,
// not "." or "..", so that it can be a part of a URL; a collection name 1..64 of letters, digits,
// . _ -; an object is at most 512 bytes of UTF-8 without control characters; a source 4096.
void CheckImageId(std::string_view id);
void CheckCollectionName(std::string_view name);
void CheckAliasName(std::string_view name);    // as a collection's name
void CheckDisplayName(std::string_view name);  // as an object, 200 bytes, or empty
void CheckObject(std::string_view object);
void CheckSource(std::string_view source);

// A JSON object of at most 64 KiB, 32 levels and 1000 names an object, rewritten with sorted keys
// and no white space so that equal metadata compare equal. Throws kInvalidArgument
// "metadata_invalid".
std::string CanonicalMetadata(const std::string& metadata);

}  // namespace pliant
