// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The web page, built into the program.
#include "server/routes/routes.h"
#include "server/web/web_assets.h"

namespace pliant::server {

namespace {

constexpr const char* kContentSecurityPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

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

}  // namespace pliant::server
