// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// When an upload changes nothing, and when it contradicts what is stored.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "index/records/records.h"

namespace pliant {

// Of a request with an id: whether `stored`, the image of that id, is the same already.
bool IsUnchanged(const ImageRecord& stored, const AddRequest& request, const std::string& sha256);

// Of a request without an id: which of the images with its bytes it means. Without an id the
// bytes say which image is meant. It must not get another object or other metadata in silence,
// nor keep its own in silence: kConflict "same_bytes". What is left out is not asked for.
std::optional<ImageRecord> FindMeant(const std::vector<ImageRecord>& same_bytes,
                                     const AddRequest& request);

}  // namespace pliant
