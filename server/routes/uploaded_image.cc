// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/uploaded_image.h"

#include <algorithm>
#include <utility>

#include "descriptor/base/base64.h"
#include "index/files/text.h"
#include "server/http/json.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMaxFilenameBytes = 255;

// The last part of what a client says its file is called, as far as it can be shown.
std::string BaseName(const std::string& filename) {
  const std::size_t slash = filename.find_last_of("/\\");
  std::string name = slash == std::string::npos ? filename : filename.substr(slash + 1);
  const bool control =
      std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < ' ' || c == 0x7f; });
  if (control || name.size() > kMaxFilenameBytes || !IsValidUtf8(name)) return {};
  return name;
}

Bytes AsBytes(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

UploadedImage ImageOfBase64(const std::string& text, const std::string& name) {
  auto decoded = std::make_shared<std::vector<std::uint8_t>>();
  if (!Base64Decode(text, decoded.get())) ThrowInvalid(name, name + " is no base64.");
  const Bytes bytes(*decoded);
  return {bytes, {}, std::move(decoded)};
}

UploadedImage ImageOf(const Request& request, const Parameters& parameters, Fetcher& fetcher,
                      Fetcher::For whom) {
  if (const std::string* base64 = parameters.image_base64()) {
    return ImageOfBase64(*base64, "image");
  }
  if (const std::string* url = parameters.image_url()) {
    FetchedImage fetched = fetcher.Fetch(*url, whom);
    const Bytes bytes(*fetched.bytes);
    return {bytes, std::move(fetched.source), std::move(fetched.bytes)};
  }
  if (!request.is_multipart()) {
    if (request.has_body && request.content_type != "application/json")
      return {AsBytes(request.body), {}, {}};
    throw ProblemError("missing_parameter",
                       "An image is required: as the body, as the form field 'image', or in a "
                       "JSON body as base64 in 'image' or by its address in 'image_url'.")
        .Parameter("image");
  }
  const std::vector<UploadedImage> images = ImagesOf(request);
  if (images.size() > 1) {
    throw ProblemError("duplicate_parameter", "There is more than one form field 'image'.")
        .Parameter("image");
  }
  return images.front();
}

std::vector<UploadedImage> ImagesOf(const Request& request) {
  std::vector<UploadedImage> images;
  for (const Part& part : request.parts) {
    if (part.name == "image")
      images.push_back({AsBytes(part.content), BaseName(part.filename), {}});
  }
  if (images.empty()) {
    throw ProblemError("missing_parameter", "The form field 'image' is required.")
        .Parameter("image");
  }
  return images;
}

}  // namespace pliant::server
