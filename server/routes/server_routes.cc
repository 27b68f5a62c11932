// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The server itself: the web page built into the program, health, metrics, the OpenAPI document.
#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "descriptor/base/error.h"
#include "index/store/database_url.h"
#include "server/http/problem.h"
#include "server/openapi/document.h"
#include "server/routes/answers.h"
#include "server/routes/routes.h"
#include "server/web/web_assets.h"

namespace pliant::server {
namespace {

constexpr const char* kContentSecurityPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

Response PageResponse(const WebAsset& asset) {
  return {.content_type = asset.content_type,
          .body = std::string(asset.data, asset.bytes),
          .headers = {{"Cache-Control", "no-cache"},
                      {"ETag", std::string("\"") + asset.sha256 + "\""},
                      {"Content-Security-Policy", kContentSecurityPolicy},
                      {"Referrer-Policy", "no-referrer"},
                      {"X-Frame-Options", "DENY"},
                      {"Cross-Origin-Opener-Policy", "same-origin"}}};
}

Response Live(Service&, const Request&, const Parameters&) {
  return JsonResponse({{"status", "alive"}});
}

Response Ready(Service& service, const Request&, const Parameters&) {
  if (!service.ready()) {
    const double share = service.loaded();
    Problem problem =
        ProblemError("starting",
                     fmt::format("The index is still loading: {:.0f} % done.", 100 * share))
            .problem();
    problem.progress = share;
    throw ProblemError(problem);
  }
  service.engine().ListCollections();  // the database answers
  Json json = {{"status", "ready"}};
  if (service.peers() != nullptr) {
    const std::int64_t followed = service.engine().followed();
    json["parts"] = Json::array();
    for (const PeerState& peer : service.peers()->states()) {
      const bool answers = peer.answers && peer.database == service.engine().database();
      const auto behind = std::max<std::int64_t>(0, followed - peer.followed);
      json["parts"].push_back({{"part", peer.part},
                               {"server", peer.server},
                               {"answers", answers},
                               {"behind", answers ? Json(behind) : Json(nullptr)}});
    }
  }
  return JsonResponse(json);
}

Response MetricsText(Service& service, const Request&, const Parameters&) {
  std::optional<EngineStats> stats;
  if (service.ready()) stats = service.figures().Get();
  MetricsNow now{service.pool.load(), stats ? &*stats : nullptr};
  if (service.ready()) {
    try {
      now.jobs = service.jobs->Counts();
    } catch (const Error& error) {
      spdlog::warn("cannot count the jobs: {}", error.what());
    }
    if (service.decoders() != nullptr) now.decoders = service.decoders()->size();
  }
  // 0 if the disk does not answer, for example after the database went away.
  std::error_code unknown;
  const std::filesystem::space_info disk =
      std::filesystem::space(FolderOf(service.options.engine.database), unknown);
  now.disk_free_bytes = unknown ? 0 : disk.available;
  return {.content_type = "text/plain; version=0.0.4; charset=utf-8",
          .body = service.metrics.Text(now)};
}

}  // namespace

void AddServerRoutes(RouteTable& table) {
  for (const WebAsset& asset : WebAssets()) {
    table
        .Add(std::string("GET ") + asset.path, "page",
             [asset](const Request&, const Parameters&) { return PageResponse(asset); })
        .Summary("Get the web page")
        .Needs(Scope::kPublic)
        .Sends(asset.content_type, "the page or one of its files")
        .AnswersNotModified()
        .WithoutIndex();
  }
  table.Add("GET /livez", "livez", Live)
      .Summary("Check that the process runs")
      .Needs(Scope::kPublic)
      .Answers(200, "the process runs", "Status")
      .WithoutIndex();
  table.Add("GET /readyz", "readyz", Ready)
      .Summary("Check that the index is loaded and the database answers")
      .Needs(Scope::kPublic)
      .Answers(200, "the server is ready", "Status")
      .Codes({"starting"})
      .WithoutIndex();
  table.Add("GET /metrics", "metrics", MetricsText)
      .Summary("Get counters and histograms for Prometheus")
      .Sends("text/plain", "the text exposition format")
      .WithoutIndex();
}

void AddDocumentRoute(RouteTable& table) {
  const auto document = std::make_shared<Json>();
  const auto answer = std::make_shared<Response>();
  table
      .Add("GET /v1/openapi.json", "openapi",
           [document, answer](const Request& request, const Parameters&) {
             if (request.base_path.empty()) return *answer;
             Json moved = *document;
             moved["servers"][0]["url"] = request.base_path;
             return TaggedResponse(moved);
           })
      .Summary("Get this document")
      .Needs(Scope::kPublic)
      .Sends("application/json", "an OpenAPI 3.1 document, with ETag")
      .AnswersNotModified()
      .WithoutIndex();
  *document = OpenApiDocument(table.routes());  // with this route
  *answer = TaggedResponse(*document);
}

}  // namespace pliant::server
