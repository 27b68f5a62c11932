// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The route table, and the handlers by what they serve.
#pragma once

#include <vector>

#include "server/http/parameters.h"
#include "server/http/router.h"
#include "server/routes/service.h"

namespace pliant::server {

// All routes. `service` must outlive them.
std::vector<Route> MakeRoutes(Service& service);

// Each adds its routes to the table.
void AddPageRoutes(std::vector<Route>& routes);
void AddMeRoute(Service& service, std::vector<Route>& routes);
void AddKeyRoutes(Service& service, std::vector<Route>& routes);
void AddHealthRoutes(Service& service, std::vector<Route>& routes);
void AddCollectionRoutes(Service& service, std::vector<Route>& routes);
void AddAliasRoutes(Service& service, std::vector<Route>& routes);
void AddImageRoutes(Service& service, std::vector<Route>& routes);
void AddImageDataRoutes(Service& service, std::vector<Route>& routes);
void AddChangeRoutes(Service& service, std::vector<Route>& routes);
void AddImportRoutes(Service& service, std::vector<Route>& routes);
void AddBackupRoutes(Service& service, std::vector<Route>& routes);
void AddObjectRoutes(Service& service, std::vector<Route>& routes);
void AddExportRoutes(Service& service, std::vector<Route>& routes);
void AddSearchRoutes(Service& service, std::vector<Route>& routes);
void AddCompareRoutes(Service& service, std::vector<Route>& routes);
void AddPreviewRoute(Service& service, std::vector<Route>& routes);
void AddVocabularyRoutes(Service& service, std::vector<Route>& routes);
void AddDemoRoutes(Service& service, std::vector<Route>& routes);
// Last: it describes all others.
void AddDocumentRoute(std::vector<Route>& routes);
void AddJobRoutes(Service& service, std::vector<Route>& routes);

}  // namespace pliant::server
