// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/request_body.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "descriptor/base/base64.h"
#include "index/files/text.h"
#include "server/http/json.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMostFilenameBytes = 1000;

// The last part of the file name that a client gave. Bytes that are not UTF-8 and control
// characters are escaped, and of a longer name only the first bytes are taken.
std::string BaseName(const std::string& filename) {
  return Shown(filename.substr(filename.find_last_of("/\\") + 1), kMostFilenameBytes);
}

Bytes AsBytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

UploadedImage ImageOfBase64(const std::string& text, const std::string& name) {
  auto decoded = std::make_shared<std::vector<std::uint8_t>>();
  if (!Base64Decode(text, decoded.get())) ThrowInvalid(name, name + " must be valid base64.");
  const Bytes bytes(*decoded);
  return {bytes, {}, std::move(decoded)};
}

UploadedImage ImageOfFetched(FetchedImage fetched) {
  const Bytes bytes(*fetched.bytes);
  return {bytes, std::move(fetched.source), std::move(fetched.bytes)};
}

std::vector<UploadedImage> ImageParts(const Request& request) {
  std::vector<UploadedImage> images;
  for (const Part& part : request.parts) {
    if (part.name == kImagePart)
      images.push_back({AsBytes(part.content), BaseName(part.filename), {}});
  }
  return images;
}

bool HasImage(const Request& request, const Parameters& parameters) {
  if (request.content_type == "application/json") {
    return parameters.Image() != nullptr;
  }
  return request.is_multipart() ? !ImageParts(request).empty() : request.has_body;
}

UploadedImage ImageOf(const Request& request, const Parameters& parameters, Fetcher& fetcher,
                      Fetcher::For whom) {
  if (!HasImage(request, parameters)) {
    throw ProblemError("missing_parameter",
                       "An image is required. Send it as the body or form field 'image', or as "
                       "'image' (base64) or 'image_url' in JSON.",
                       {.parameter = kImagePart});
  }
  if (const ImageText* named = parameters.Image()) {
    return named->base64 ? ImageOfBase64(*named->base64, kImagePart)
                         : ImageOfFetched(fetcher.Fetch(*named->url, whom));
  }
  if (!request.is_multipart()) return {AsBytes(request.body), {}, {}};
  std::vector<UploadedImage> images = ImageParts(request);
  if (images.size() > 1) {
    throw ProblemError("duplicate_parameter", "The form has several fields 'image'. Send one.",
                       {.parameter = kImagePart});
  }
  return std::move(images.front());
}

Json MergePatchOf(const Request& request, const std::vector<std::string>& fields) {
  if (request.body.empty()) {
    throw ProblemError("missing_parameter", "The body must be a JSON merge patch.",
                       {.parameter = "body"});
  }
  Json patch = ParseJson(request.body, "body");
  for (const auto& [name, value] : patch.items()) {
    if (fields.empty() || std::find(fields.begin(), fields.end(), name) != fields.end()) continue;
    throw ProblemError("unknown_parameter",
                       fmt::format("'{}' cannot be changed. This route changes only: {}.",
                                   name.substr(0, 64), fmt::join(fields, ", ")),
                       {.parameter = name.substr(0, 64)});
  }
  return patch;
}

std::optional<std::string> TextIn(const Json& patch, const std::string& name) {
  const auto it = patch.find(name);
  if (it == patch.end()) return std::nullopt;
  if (it->is_null()) return "";
  if (!it->is_string()) ThrowInvalid(name, name + " must be text or null.");
  return it->get<std::string>();
}

}  // namespace pliant::server
