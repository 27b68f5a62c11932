// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Forms with files: multipart/form-data (RFC 7578).
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/message.h"

namespace pliant::server {

inline constexpr const char* kImagePart = "image";  // the parts of that name are images

// The parts of a whole body. Throws ProblemError "bad_request" for a damaged body or more than
// `most_parts` parts, "body_too_large" for a long part that is not an image.
std::vector<Part> ParseMultipart(std::string_view content_type, std::string_view body,
                                 std::size_t most_parts);

}  // namespace pliant::server
