// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/routes.h"

#include "server/routes/repeatable.h"

namespace pliant::server {

std::vector<Route> MakeRoutes(Service& service) {
  std::vector<Route> routes;
  AddPageRoutes(routes);
  AddHealthRoutes(service, routes);
  AddMeRoute(service, routes);
  AddKeyRoutes(service, routes);
  AddCollectionRoutes(service, routes);
  AddAliasRoutes(service, routes);
  AddImageRoutes(service, routes);
  AddImageDataRoutes(service, routes);
  AddChangeRoutes(service, routes);
  AddImportRoutes(service, routes);
  AddObjectRoutes(service, routes);
  AddExportRoutes(service, routes);
  AddSearchRoutes(service, routes);
  AddCompareRoutes(service, routes);
  AddPreviewRoute(service, routes);
  AddVocabularyRoutes(service, routes);
  AddDemoRoutes(service, routes);
  AddJobRoutes(service, routes);
  AddBackupRoutes(service, routes);
  AddDocumentRoute(routes);
  for (Route& route : routes) {
    if (HeedsIdempotencyKey(route)) route.handler = Repeatable(service, std::move(route.handler));
  }
  return routes;
}

}  // namespace pliant::server
