// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The handlers, by what they serve. Each function adds its routes to the table.
#pragma once

#include <vector>

#include "server/app/service.h"
#include "server/http/router.h"

namespace pliant::server {

void AddPageRoutes(std::vector<Route>& routes);
void AddHealthRoutes(Service& service, std::vector<Route>& routes);
void AddCollectionRoutes(Service& service, std::vector<Route>& routes);
void AddImageRoutes(Service& service, std::vector<Route>& routes);
void AddImageDataRoutes(Service& service, std::vector<Route>& routes);
void AddBatchRoutes(Service& service, std::vector<Route>& routes);
void AddBackupRoutes(Service& service, std::vector<Route>& routes);
void AddObjectRoutes(Service& service, std::vector<Route>& routes);
void AddSearchRoutes(Service& service, std::vector<Route>& routes);
void AddVocabularyRoutes(Service& service, std::vector<Route>& routes);
void AddDemoRoutes(Service& service, std::vector<Route>& routes);
// Last: it describes all others.
void AddDocumentRoute(std::vector<Route>& routes);
void AddJobRoutes(Service& service, std::vector<Route>& routes);

}  // namespace pliant::server
