// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What belongs to one picture: its original bytes, a thumbnail, its features.
#include "descriptor/base/base64.h"
#include "index/files/features_npz.h"
#include "server/http/conditions.h"
#include "server/http/json.h"
#include "server/http/problem.h"
#include "server/routes/changes.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

// Pictures come from strangers: whatever their bytes are, a browser must not run them. Who names
// the bytes may keep them: at that address they are never others. Another key may not see them.
void AddPictureHeaders(Response& response, const std::string& etag, const ImageRecord& image,
                       const Parameters& parameters) {
  const bool named = parameters.Text("sha256") == image.sha256;
  response.headers.emplace_back("ETag", etag);
  response.headers.emplace_back(
      "Cache-Control", named ? "private, max-age=31536000, immutable" : "private, no-cache");
  response.headers.emplace_back("Vary", "Authorization, X-API-Key");
  response.headers.emplace_back("Content-Security-Policy", "default-src 'none'; sandbox");
}

Response Content(Service& service, const Request& request, const Parameters& parameters) {
  const std::string collection = CollectionOf(service, request);
  const ImageRecord image = service.engine().Get(collection, request.captures.at("id"));
  Response response;
  AddPictureHeaders(response, '"' + image.sha256 + '"', image, parameters);
  response.headers.emplace_back("Accept-Ranges", "bytes");
  if (!NamedByIfNoneMatch(request, '"' + image.sha256 + '"').empty()) {
    response.status = 304;
    return response;
  }
  const auto bytes = service.engine().GetContent(collection, image.id);
  response.body.assign(bytes.begin(), bytes.end());
  response.content_type =
      image.media_type.starts_with("image/") ? image.media_type : "application/octet-stream";
  return response;
}

Response Thumbnail(Service& service, const Request& request, const Parameters& parameters) {
  const std::string collection = CollectionOf(service, request);
  const ImageRecord image = service.engine().Get(collection, request.captures.at("id"));
  const std::string etag = "\"" + image.sha256 + "-" + std::to_string(kThumbnailSidePx) + "\"";
  Response response;
  AddPictureHeaders(response, etag, image, parameters);
  if (!NamedByIfNoneMatch(request, etag).empty()) {
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
Response FeaturesOf(Service& service, const Request& request, const Parameters& parameters) {
  const Features features =
      service.engine().GetFeatures(CollectionOf(service, request), request.captures.at("id"));
  if (parameters.Text("format").value_or("json") == "npz") {
    Response response;
    response.content_type = kNpzType;
    response.body = FeaturesNpz(features);
    response.headers.emplace_back("Cache-Control", "no-store");
    response.headers.emplace_back("Content-Disposition",
                                  "attachment; filename=\"" + request.captures.at("id") + ".npz\"");
    return response;
  }
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
  return TaggedResponse({{"width", features.width},
                         {"height", features.height},
                         {"model_id", features.model_id},
                         {"keypoints", keypoints},
                         {"descriptors",
                          {{"type", is_float ? "float32" : "uint8"},
                           {"rows", descriptors.rows},
                           {"dim", descriptors.dim},
                           {"base64", data}}}});
}

Parameter Sha256Parameter() {
  return {"sha256",
          "of the picture as its record has it: where it is still that, caches may keep the answer "
          "for good (Cache-Control: immutable)"};
}

}  // namespace

void AddImageDataRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "images.content",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images/{id}/content",
                    .summary = "The uploaded bytes",
                    .parameters = {Sha256Parameter()},
                    .answers = {{200, "the picture, with ETag", "", "image/*"},
                                {206, "the part that Range names", "", "image/*"},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .codes = {"image_not_found", "content_not_kept"},
                    .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE/content")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Content(service, request, parameters);
                    }});
  routes.push_back({.name = "images.thumbnail",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images/{id}/thumbnail",
                    .summary = "A JPEG preview, longer side 320 pixels",
                    .parameters = {Sha256Parameter()},
                    .answers = {{200, "the preview, with ETag", "", "image/jpeg"},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .codes = {"image_not_found", "content_not_kept", "busy"},
                    .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE/thumbnail")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Thumbnail(service, request, parameters);
                    }});
  routes.push_back(
      {.name = "images.features",
       .method = "GET",
       .pattern = "/v1/collections/{c}/images/{id}/features",
       .summary = "Key points and descriptors: as JSON, these as base64 of "
                  "little-endian rows, or as NumPy's archive",
       .parameters =
           {Parameter("format", "npz: for numpy.load").Choice({"json", "npz"}).Default("json")},
       .answers = {{200, "the features", "Features"},
                   {200, "with format=npz", "", kNpzType},
                   {304, "If-None-Match names its ETag", "", ""}},
       .codes = {"image_not_found"},
       .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE/features")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return FeaturesOf(service, request, parameters);
       }});
}

}  // namespace pliant::server
