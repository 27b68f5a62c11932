// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Is it alive, is it ready, how is it doing?
#include <filesystem>
#include <optional>
#include <system_error>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "index/store/database_url.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response MetricsText(Service& service) {
  std::optional<EngineStats> stats;
  if (service.ready()) stats = service.figures().Get();
  Response response;
  response.content_type = "text/plain; version=0.0.4; charset=utf-8";
  MetricsNow now{service.pool.load(), stats ? &*stats : nullptr};
  if (service.ready()) {
    try {
      now.jobs = service.jobs->Counts();
    } catch (const Error& error) {
      spdlog::warn("cannot count the jobs: {}", error.what());
      now.jobs.reset();
    }
    if (service.decoders() != nullptr) now.decoders = service.decoders()->size();
  }
  // Where it cannot be asked, as of a database that is gone, there is none to count on.
  std::error_code unknown;
  const std::filesystem::space_info disk =
      std::filesystem::space(FolderOf(service.options.engine.database), unknown);
  now.disk_free_bytes = unknown ? 0 : disk.available;
  response.body = service.metrics.Text(now);
  return response;
}

[[noreturn]] void ThrowStarting(const Service& service) {
  const double share = service.loaded();
  Problem problem =
      ProblemError("starting",
                   fmt::format("The index is still loading: {:.0f} % of the images.", 100 * share))
          .problem();
  problem.progress = share;
  throw ProblemError(problem);
}

}  // namespace

void AddHealthRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "livez",
       .method = "GET",
       .pattern = "/livez",
       .summary = "Whether the process runs",
       .scope = Scope::kPublic,
       .answers = {{200, "it does", "Status"}},
       .example = R"(curl "$PLIANT/livez")",
       .handler = [](const Request&,
                     const Parameters&) { return JsonResponse({{"status", "alive"}}); },
       .needs_index = false});
  routes.push_back({.name = "readyz",
                    .method = "GET",
                    .pattern = "/readyz",
                    .summary = "Whether the index is loaded and the database can be read",
                    .scope = Scope::kPublic,
                    .answers = {{200, "it is", "Status"}},
                    .codes = {"starting"},
                    .example = R"(curl "$PLIANT/readyz")",
                    .handler =
                        [&service](const Request&, const Parameters&) {
                          if (!service.ready()) ThrowStarting(service);
                          service.engine().ListCollections();  // the database can be read
                          return JsonResponse({{"status", "ready"}});
                        },
                    .needs_index = false});
  routes.push_back(
      {.name = "metrics",
       .method = "GET",
       .pattern = "/metrics",
       .summary = "Counters and histograms for Prometheus",
       .answers = {{200, "the text exposition format", "", "text/plain"}},
       .example = R"(curl "$PLIANT/metrics")",
       .handler = [&service](const Request&, const Parameters&) { return MetricsText(service); },
       .needs_index = false});
}

}  // namespace pliant::server
