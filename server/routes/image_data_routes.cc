// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What belongs to one picture: its original bytes, a thumbnail, its features.
#include "server/http/problem.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

// Pictures come from strangers: whatever their bytes are, a browser must not run them.
void AddPictureHeaders(Response& response, const std::string& etag) {
  response.headers.emplace_back("ETag", etag);
  response.headers.emplace_back("Cache-Control", "private, no-cache");
  response.headers.emplace_back("Content-Security-Policy", "default-src 'none'; sandbox");
}

Response Content(Service& service, const Request& request) {
  const std::string collection = CollectionOf(request);
  const ImageRecord image = service.engine().Get(collection, request.captures.at("id"));
  Response response;
  AddPictureHeaders(response, '"' + image.sha256 + '"');
  if (IfNoneMatch(request, '"' + image.sha256 + '"')) {
    response.status = 304;
    return response;
  }
  const auto bytes = service.engine().GetContent(collection, image.id);
  response.body.assign(bytes.begin(), bytes.end());
  response.content_type =
      image.media_type.starts_with("image/") ? image.media_type : "application/octet-stream";
  return response;
}

Response Thumbnail(Service& service, const Request& request) {
  const std::string collection = CollectionOf(request);
  const ImageRecord image = service.engine().Get(collection, request.captures.at("id"));
  const std::string etag = "\"" + image.sha256 + "-" + std::to_string(kThumbnailSidePx) + "\"";
  Response response;
  AddPictureHeaders(response, etag);
  if (IfNoneMatch(request, etag)) {
    response.status = 304;
    return response;
  }
  std::shared_ptr<const std::string> jpeg = service.thumbnails.Find(image.sha256);
  if (!jpeg) {
    const std::vector<std::uint8_t> original = service.engine().GetContent(collection, image.id);
    service.pool.Run(WorkerPool::Lane::kSearch, [&](int) {
      jpeg = std::make_shared<const std::string>(
          MakeThumbnail(original, service.options.engine.extraction.decode, service.decode()));
    });
    service.thumbnails.Insert(image.sha256, jpeg);
  }
  response.content_type = "image/jpeg";
  response.body = *jpeg;
  return response;
}

// Descriptors row by row, little-endian; base64 keeps them exact and a third of the size of
// decimal numbers.
Response FeaturesOf(Service& service, const Request& request) {
  const Features features =
      service.engine().GetFeatures(CollectionOf(request), request.captures.at("id"));
  Json keypoints = Json::array();
  for (const Keypoint& point : features.keypoints) {
    keypoints.push_back({{"x", point.x},
                         {"y", point.y},
                         {"size", point.size},
                         {"angle", point.angle},
                         {"response", point.response}});
  }
  const Descriptors& descriptors = features.descriptors;
  const bool is_float = descriptors.kind == DescriptorKind::kFloat;
  const std::string data =
      is_float ? Base64(descriptors.floats.data(), descriptors.floats.size() * sizeof(float))
               : Base64(descriptors.bytes.data(), descriptors.bytes.size());
  return JsonResponse({{"width", features.width},
                       {"height", features.height},
                       {"model_id", features.model_id},
                       {"keypoints", keypoints},
                       {"descriptors",
                        {{"type", is_float ? "float32" : "uint8"},
                         {"rows", descriptors.rows},
                         {"dim", descriptors.dim},
                         {"base64", data}}}});
}

}  // namespace

void AddImageDataRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "images.content",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images/{id}/content",
                    .summary = "The uploaded bytes",
                    .answers = {{200, "the picture, with ETag", "", "image/*"},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .codes = {"image_not_found", "content_not_kept"},
                    .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE/content")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Content(service, request);
                    }});
  routes.push_back({.name = "images.thumbnail",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images/{id}/thumbnail",
                    .summary = "A JPEG preview, longer side 320 pixels",
                    .answers = {{200, "the preview, with ETag", "", "image/jpeg"},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .codes = {"image_not_found", "content_not_kept", "busy"},
                    .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE/thumbnail")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Thumbnail(service, request);
                    }});
  routes.push_back({.name = "images.features",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images/{id}/features",
                    .summary = "Key points, and descriptors as base64 of little-endian rows",
                    .answers = {{200, "the features", "Features"}},
                    .codes = {"image_not_found"},
                    .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE/features")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return FeaturesOf(service, request);
                    }});
}

}  // namespace pliant::server
