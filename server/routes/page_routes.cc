// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The web page, built into the program.
#include <memory>

#include "server/openapi/document.h"
#include "server/routes/answers.h"
#include "server/routes/changes.h"
#include "server/routes/routes.h"
#include "server/web/web_assets.h"

namespace pliant::server {
namespace {

constexpr const char* kContentSecurityPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

Response Get(Service& service, const Request& request) {
  const std::string& collection = CollectionOf(service, request);
  Json objects = Json::array();
  for (const DemonstrationObject& object : kDemonstrationObjects) {
    objects.push_back({{"object", object.name},
                       {"image_id", object.id()},
                       {"crumpled", std::string("/assets/demo/") + object.file + "-crumpled.jpg"}});
  }
  return JsonResponse(
      {{"loaded", HasDemonstration(service.engine(), collection)}, {"objects", objects}});
}

Response Load(Service& service, const Request& request) {
  return JobResponse(
      AddDemonstrationJob(service.engine(), *service.jobs, CollectionOf(service, request)));
}

}  // namespace

void AddPageRoutes(std::vector<Route>& routes) {
  for (const WebAsset& asset : WebAssets()) {
    routes.push_back({.name = "page",
                      .method = "GET",
                      .pattern = asset.path,
                      .summary = "The web page",
                      .scope = Scope::kPublic,
                      .answers = {{200, "the page or a part of it", "", asset.content_type},
                                  {304, "If-None-Match names its ETag", "", ""}},
                      .handler =
                          [asset](const Request&, const Parameters&) {
                            const std::string etag = std::string("\"") + asset.sha256 + "\"";
                            Response response;
                            response.headers = {{"Cache-Control", "no-cache"},
                                                {"ETag", etag},
                                                {"Content-Security-Policy", kContentSecurityPolicy},
                                                {"Referrer-Policy", "no-referrer"},
                                                {"X-Frame-Options", "DENY"},
                                                {"Cross-Origin-Opener-Policy", "same-origin"}};
                            response.content_type = asset.content_type;
                            response.body.assign(asset.data, asset.bytes);
                            return response;
                          },
                      .needs_index = false});
  }
}

void AddDocumentRoute(std::vector<Route>& routes) {
  const auto answer = std::make_shared<Response>();
  routes.push_back({.name = "openapi",
                    .method = "GET",
                    .pattern = "/v1/openapi.json",
                    .summary = "This document",
                    .scope = Scope::kPublic,
                    .answers = {{200, "an OpenAPI 3.1 document, with ETag"},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .example = R"(curl "$PLIANT/v1/openapi.json")",
                    .handler = [answer](const Request&, const Parameters&) { return *answer; },
                    .needs_index = false});
  *answer = TaggedResponse(OpenApiDocument(routes));  // with this route
}

void AddDemoRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "demo.get",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/demo",
                    .summary = "The demonstration objects, and whether they were added",
                    .answers = {{200, "all of them", "Demo"}},
                    .example = R"(curl "$PLIANT/v1/collections/default/demo")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Get(service, request);
                    }});
  routes.push_back({.name = "demo.load",
                    .method = "POST",
                    .pattern = "/v1/collections/{c}/demo",
                    .summary = "Add the demonstration objects, in the background",
                    .scope = Scope::kWrite,
                    .body = BodyKind::kJson,
                    .answers = {{202, "the job; Location has its address", "Job"}},
                    .example = R"(curl -X POST "$PLIANT/v1/collections/toys/demo")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Load(service, request);
                    }});
}

}  // namespace pliant::server
