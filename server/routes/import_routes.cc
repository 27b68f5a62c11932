// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Many images in one body, or in a folder on the server, added in the background.
#include "index/store/database_url.h"
#include "server/http/file_error.h"
#include "server/http/problem.h"
#include "server/jobs/import_jobs.h"
#include "server/routes/adding.h"
#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response Import(Service& service, const Request& request, const Parameters& parameters) {
  const CollectionRecord collection =
      service.engine().GetCollection(CollectionOf(service, request));
  if (request.received ? request.received->All().empty() : request.body.empty()) {
    throw ProblemError("missing_parameter", "The body has no images.").Parameter("body");
  }
  BulkDefaults defaults;
  defaults.object = parameters.Text("object").value_or("");
  defaults.metadata = parameters.JsonObject("metadata").value_or("{}");
  defaults.object_from = parameters.Text("object_from").value_or("auto");
  if (!request.received) {  // the database will have the body
    RequireDiskSpace(FolderOf(service.options.engine.database), request.body.size(),
                     service.options.engine.reserve_bytes);
  }
  return JobResponse(AddBulkImportJob(*service.jobs, collection, request, defaults));
}

// For a body that is too large for the database.
std::shared_ptr<BodySink> ReceiveImport(Service& service, const Request& request,
                                        std::uint64_t bytes) {
  service.engine().GetCollection(CollectionOf(service, request));  // or it is not found
  service.bulk_files.Sweep(*service.jobs);
  return service.bulk_files.Receive(bytes);
}

Response ImportFolder(Service& service, const Request& request, const Parameters& parameters) {
  const CollectionRecord collection =
      service.engine().GetCollection(CollectionOf(service, request));
  const std::string folder = parameters.Text("folder").value_or("");
  ResolveImportFolder(service.options.import_dir, folder);  // says now what is wrong with it
  return JobResponse(AddImportJob(*service.jobs, collection, folder,
                                  parameters.Text("object_from").value_or("auto")));
}

}  // namespace

void AddImportRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "images.import",
       .method = "POST",
       .pattern = "/v1/collections/{c}/images:import",
       .summary = "Add many images in the background: lines of JSON with base64, or a TAR archive",
       .scope = Scope::kWrite,
       .body = BodyKind::kBulk,
       .parameters = {{"object", "what all images show that do not say otherwise"},
                      MetadataParameter(),
                      Parameter("object_from",
                                "of a TAR, what names an image's object; auto: its folder where "
                                "there are folders, else the file's name")
                          .Choice({"auto", "folder", "stem", "none"})
                          .Default("auto")},
       .answers = {{202, "the job; its items say what became of each image", "Job"}},
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
  routes.push_back(
      {.name = "imports.create",
       .method = "POST",
       .pattern = "/v1/collections/{c}/imports",
       .summary = "Add the images of a folder on the server, in the background",
       .scope = Scope::kAdmin,
       .body = BodyKind::kJson,
       .parameters =
           {Parameter("folder", "path inside --import-dir; \".\" is all of it").Required(),
            Parameter("object_from",
                      "what names an image's object; auto: stem for a folder without "
                      "folders, else folder")
                .Choice({"auto", "folder", "stem", "none"})
                .Default("auto")},
       .answers = {{202, "the job; Location has its address", "Job"}},
       .codes = {"imports_off"},
       .example = R"(curl -H "Content-Type: application/json" -d '{"folder": "shelf"}' )"
                  R"("$PLIANT/v1/collections/default/imports")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return ImportFolder(service, request, parameters);
       }});
}

}  // namespace pliant::server
