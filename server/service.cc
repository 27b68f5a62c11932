// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/service.h"

#include "server/routes/routes.h"

namespace pliant::server {

Service::Service(const ServerOptions& server_options)
    : options(server_options),
      pool(MakeWorkerPoolOptions(server_options)),
      jobs(std::make_unique<JobQueue>()) {}

// Who uses something ends before it: the trainer uses jobs, jobs use the engine and the pool.
Service::~Service() {
  ready_ = false;
  auto_trainer_.reset();
  jobs.reset();
}

void Service::Open() {
  engine_ = std::make_unique<Engine>(MakeEngineOptions(options));
  if (options.auto_train) {
    auto_trainer_ = std::make_unique<AutoTrainer>(*engine_, pool, *jobs);
  }
  ready_ = true;
}

std::vector<Route> MakeRoutes(Service& service) {
  std::vector<Route> routes;
  AddPageRoutes(routes);
  AddHealthRoutes(service, routes);
  AddCollectionRoutes(service, routes);
  AddImageRoutes(service, routes);
  AddImageDataRoutes(service, routes);
  AddObjectRoutes(service, routes);
  AddSearchRoutes(service, routes);
  AddVocabularyRoutes(service, routes);
  AddDemoRoutes(service, routes);
  AddJobRoutes(service, routes);
  return routes;
}

}  // namespace pliant::server
