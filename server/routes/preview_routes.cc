// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a picture looks like that is not stored: one that the server fetches, or that a browser
// cannot read.
#include "server/routes/routes.h"
#include "server/routes/uploaded_image.h"

namespace pliant::server {

namespace {

Response Preview(Service& service, const Request& request, const Parameters& parameters) {
  const UploadedImage image = ImageOf(request, parameters, service.fetcher);
  Response response;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int) {
    response.body =
        MakeThumbnail(image.bytes, service.options.engine.extraction.decode, service.decode());
  });
  response.content_type = "image/jpeg";
  response.headers.emplace_back("Cache-Control", "no-store");
  response.headers.emplace_back("Content-Security-Policy", "default-src 'none'; sandbox");
  return response;
}

}  // namespace

void AddPreviewRoute(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "preview",
                    .method = "POST",
                    .pattern = "/v1/preview",
                    .summary = "A JPEG preview of a picture that is not stored, longer side 320 "
                               "pixels",
                    .body = BodyKind::kImageOrJson,
                    .answers = {{200, "the preview", "", "image/jpeg"}},
                    .example = R"(curl -F image=@mug.png -o small.jpg "$PLIANT/v1/preview")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Preview(service, request, parameters);
                    }});
}

}  // namespace pliant::server
