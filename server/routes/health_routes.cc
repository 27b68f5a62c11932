// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Is it alive, is it ready, how is it doing?
#include "server/problem.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response MetricsText(Service& service) {
  std::optional<EngineStats> stats;
  if (service.ready()) stats = service.engine().Stats();
  Response response;
  response.content_type = "text/plain; version=0.0.4; charset=utf-8";
  response.body = service.metrics.Text(service.pool.load(), stats ? &*stats : nullptr);
  return response;
}

}  // namespace

void AddHealthRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "livez",
                    .method = "GET",
                    .pattern = "/livez",
                    .scope = Scope::kPublic,
                    .handler =
                        [](const Request&, const Parameters&) {
                          return JsonResponse({{"status", "alive"}});
                        },
                    .needs_index = false});
  routes.push_back({.name = "readyz",
                    .method = "GET",
                    .pattern = "/readyz",
                    .scope = Scope::kPublic,
                    // Needs the index: the HTTP layer answers "starting" until it is there.
                    .handler = [](const Request&, const Parameters&) {
                      return JsonResponse({{"status", "ready"}});
                    }});
  routes.push_back(
      {.name = "metrics",
       .method = "GET",
       .pattern = "/metrics",
       .handler = [&service](const Request&, const Parameters&) { return MetricsText(service); },
       .needs_index = false});
}

}  // namespace pliant::server
