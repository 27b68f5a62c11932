// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Many pictures in one body, added in the background, and what became of each.
#include <filesystem>

#include "index/store/database_url.h"
#include "server/http/problem.h"
#include "server/jobs/bulk_import.h"
#include "server/routes/adding.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

// The body waits in the database, beside which as much must stay free as uploads leave.
void RequireSpace(const Service& service, std::size_t bytes) {
  const EngineOptions& engine = service.options.engine;
  std::error_code error;
  const auto space = std::filesystem::space(FolderOf(engine.database), error);
  if (!error && space.available < engine.reserve_bytes + bytes) {
    throw ProblemError("no_space", "The server's disk has no space for this.");
  }
}

Response Import(Service& service, const Request& request, const Parameters& parameters) {
  const CollectionRecord collection =
      service.engine().GetCollection(CollectionOf(service, request));
  if (request.received ? request.received->All().empty() : request.body.empty()) {
    throw ProblemError("missing_parameter", "The body has no pictures.").Parameter("body");
  }
  BulkDefaults defaults;
  defaults.object = parameters.Text("object").value_or("");
  defaults.metadata = parameters.JsonObject("metadata").value_or("{}");
  defaults.object_from = parameters.Text("object_from").value_or("auto");
  if (request.received) {
    auto& upload = static_cast<BulkUpload&>(*request.received);
    return JobResponse(
        AddBulkImportJob(*service.jobs, collection, upload, request.content_type, defaults));
  }
  RequireSpace(service, request.body.size());
  return JobResponse(
      AddBulkImportJob(*service.jobs, collection, request.body, request.content_type, defaults));
}

// For a body that is too large for the database.
std::shared_ptr<BodySink> ReceiveImport(Service& service, const Request& request,
                                        std::uint64_t bytes) {
  service.engine().GetCollection(CollectionOf(service, request));  // or it is not found
  service.bulk_files.Sweep(*service.jobs);
  return service.bulk_files.Receive(bytes);
}

Response Items(Service& service, const Request& request, const Parameters& parameters) {
  const std::string id = JobOf(*service.jobs, request).id;
  const std::string identity = ToText(Json::array({"job_items", id}));
  const std::string after = AfterFromCursor(parameters, identity);
  const int limit = PageLimit(parameters);
  std::uint64_t first = 0;
  for (const char digit : after) {
    if (digit < '0' || digit > '9' || first > kMostBulkItems) ThrowInvalidCursor();
    first = first * 10 + static_cast<std::uint64_t>(digit - '0');
  }
  const auto texts = service.jobs->store().JobItems(id, first, limit + 1);
  Json items = Json::array();
  for (std::size_t i = 0; i < texts.size() && i < static_cast<std::size_t>(limit); ++i) {
    Json item = Json::parse(texts[i], nullptr, /*allow_exceptions=*/false);
    if (item.is_object()) items.push_back(std::move(item));
  }
  const bool more = texts.size() > static_cast<std::size_t>(limit);
  const std::string next = std::to_string(first + static_cast<std::uint64_t>(limit));
  return JsonResponse({{"items", std::move(items)},
                       {"next", more ? Json(MakeCursor(identity, next)) : Json(nullptr)}});
}

}  // namespace

void AddBulkRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "images.import",
       .method = "POST",
       .pattern = "/v1/collections/{c}/images:import",
       .summary =
           "Add many pictures in the background: lines of JSON with base64, or a TAR archive",
       .scope = Scope::kWrite,
       .body = BodyKind::kBulk,
       .parameters = {{"object", "what all pictures show that do not say otherwise"},
                      MetadataParameter(),
                      Parameter("object_from",
                                "of a TAR, what names a picture's object; auto: its folder where "
                                "there are folders, else the file's name")
                          .Choice({"auto", "folder", "stem", "none"})
                          .Default("auto")},
       .answers = {{202, "the job; its items say what became of each picture", "Job"}},
       .codes = {"missing_parameter"},
       .example = R"(tar cf - mug.png cup.png | curl -H "Content-Type: application/x-tar" )"
                  R"(--data-binary @- "$PLIANT/v1/collections/default/images:import")",
       .handler =
           [&service](const Request& request, const Parameters& parameters) {
             return Import(service, request, parameters);
           },
       .receive = [&service](
                      const Request& request,
                      std::uint64_t bytes) { return ReceiveImport(service, request, bytes); }});
  routes.push_back({.name = "jobs.items",
                    .method = "GET",
                    .pattern = "/v1/jobs/{id}/items",
                    .summary = "What became of each item of a job, page by page",
                    .parameters = {CursorParameter(), LimitParameter()},
                    .answers = {{200, "a page; empty for jobs without items", "JobItems"}},
                    .codes = {"job_not_found"},
                    .example = R"(curl "$PLIANT/v1/jobs/$JOB/items")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Items(service, request, parameters);
                    }});
}

}  // namespace pliant::server
