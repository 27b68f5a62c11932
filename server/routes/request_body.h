// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The bodies of requests: images and merge patches.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "descriptor/image/image.h"
#include "server/fetch/fetcher.h"
#include "server/http/message.h"
#include "server/http/parameters.h"

namespace pliant::server {

struct UploadedImage {
  Bytes bytes;           // inside the request, or `decoded`
  std::string filename;  // base name, or the URL it was fetched from; for people; may be empty
  std::shared_ptr<const std::vector<std::uint8_t>> decoded = {};  // from base64, or fetched
};

// Whether the request has an image, beside its parameters.
bool HasImage(const Request& request, const Parameters& parameters);

// The image of the request: a raw body, the multipart part "image", or in a JSON body the key
// "image" (base64) or "image_url", which is fetched. Throws ProblemError "missing_parameter",
// "duplicate_parameter", "invalid_parameter" for invalid base64, and what Fetcher::Fetch throws.
UploadedImage ImageOf(const Request& request, const Parameters& parameters, Fetcher& fetcher,
                      Fetcher::For whom = Fetcher::For::kRequest);
// Throws ProblemError "invalid_parameter" for `name`.
UploadedImage ImageOfBase64(const std::string& text, const std::string& name);
UploadedImage ImageOfFetched(FetchedImage fetched);
// All parts "image".
std::vector<UploadedImage> ImageParts(const Request& request);

// A JSON merge patch (RFC 7396). Throws ProblemError "missing_parameter" without a body,
// "invalid_json", and "unknown_parameter" for a key that is not one of `fields` (empty: any key).
Json MergePatchOf(const Request& request, const std::vector<std::string>& fields);
// Its text of this key; null counts as "". Absent = stays as it is. Throws ProblemError
// "invalid_parameter".
std::optional<std::string> TextIn(const Json& patch, const std::string& name);

}  // namespace pliant::server
