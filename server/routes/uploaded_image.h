// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The images that a request brings.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "descriptor/image/image.h"
#include "server/fetch/fetcher.h"
#include "server/http/message.h"
#include "server/http/parameters.h"

namespace pliant::server {

struct UploadedImage {
  Bytes bytes;           // inside the request, or `decoded`
  std::string filename;  // base name, or the address it was fetched from; for people; may be empty
  std::shared_ptr<const std::vector<std::uint8_t>> decoded = {};  // of base64, or fetched
};

// The image of the request: a raw body, the multipart part "image", or in a JSON body the key
// "image", as base64, or "image_url", which is fetched. Throws ProblemError "missing_parameter",
// "duplicate_parameter", "invalid_parameter" for what is no base64, and what Fetcher::Fetch throws.
UploadedImage ImageOf(const Request& request, const Parameters& parameters, Fetcher& fetcher,
                      Fetcher::For whom = Fetcher::For::kRequest);
// What is no base64 is ProblemError "invalid_parameter" for `name`.
UploadedImage ImageOfBase64(const std::string& text, const std::string& name);

// All parts "image". Throws ProblemError "missing_parameter" when there is none.
std::vector<UploadedImage> ImagesOf(const Request& request);

}  // namespace pliant::server
