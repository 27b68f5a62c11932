// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/routes.h"

namespace pliant::server {

std::vector<Route> MakeRoutes(Service& service) {
  RouteTable table(service);
  for (const auto add :
       {AddServerRoutes, AddKeyRoutes, AddQrRoutes, AddPeerRoutes, AddCollectionRoutes,
        AddImageRoutes, AddImportRoutes, AddObjectRoutes, AddExportRoutes, AddSearchRoutes,
        AddCompareRoutes, AddVocabularyRoutes, AddJobRoutes, AddBackupRoutes, AddDocumentRoute}) {
    add(table);
  }
  std::vector<Route> routes = std::move(table.routes());
  for (Route& route : routes) {
    if (HeedsIdempotencyKey(route)) route.handler = Repeatable(service, std::move(route.handler));
  }
  return routes;
}

}  // namespace pliant::server
