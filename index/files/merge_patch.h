// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace pliant {

// `metadata` with the JSON merge patch (RFC 7396) applied, as CanonicalMetadata (files/names.h)
// makes it: null removes a key, objects are merged, all else replaces. The patch "null" leaves {}.
// Throws kInvalidArgument "metadata_invalid" for a patch that is neither an object nor null, and
// for a result beyond the limits.
std::string MergeMetadata(const std::string& metadata, const std::string& patch);

}  // namespace pliant
