// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Adding many images in the background: from one body, from a folder on the server, or those of the
// demonstration.
#include "index/files/durable_file.h"
#include "index/store/database_url.h"
#include "server/http/problem.h"
#include "server/jobs/import_jobs.h"
#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response Import(Service& service, const Request& request, const Parameters& parameters) {
  const CollectionRecord collection = service.engine().GetCollection(request.captures.at("c"));
  if (request.received ? request.received->All().empty() : request.body.empty()) {
    throw ProblemError("missing_parameter", "The body is empty. Send images.",
                       {.parameter = "body"});
  }
  const BulkDefaults defaults{.object = parameters.Text("object").value_or(""),
                              .metadata = parameters.Text("metadata").value_or("{}"),
                              .object_from = parameters.Value<std::string>("object_from")};
  if (!request.received) {  // the body waits in the database
    RequireDiskSpace(FolderOf(service.options.engine.database), request.body.size(),
                     service.options.engine.reserve_bytes);
  }
  return JobResponse(AddBulkImportJob(*service.jobs, collection, request, defaults));
}

// For a body that is too large for the database.
std::shared_ptr<BodySink> ReceiveImport(Service& service, const Request& request,
                                        std::uint64_t bytes) {
  CollectionOf(service, request);  // must exist
  service.bulk_files.Sweep(*service.jobs);
  return service.bulk_files.Receive(bytes);
}

Response ImportFolder(Service& service, const Request& request, const Parameters& parameters) {
  const CollectionRecord collection = service.engine().GetCollection(request.captures.at("c"));
  const std::string folder = parameters.Text("folder").value_or("");
  ResolveImportFolder(service.options.import_dir, folder);  // throws now, not in the job
  return JobResponse(AddImportJob(*service.jobs, collection, folder,
                                  parameters.Value<std::string>("object_from")));
}

Response GetDemonstration(Service& service, const Request& request, const Parameters&) {
  Json objects = Json::array();
  for (const DemonstrationObject& object : kDemonstrationObjects) {
    objects.push_back(
        {{"object", object.name},
         {"image_id", object.id()},
         {"crumpled", request.base_path + "/assets/demo/" + object.file + "-crumpled.jpg"}});
  }
  const bool loaded = HasDemonstration(service.engine(), CollectionOf(service, request));
  return JsonResponse({{"loaded", loaded}, {"objects", objects}});
}

Response LoadDemonstration(Service& service, const Request& request, const Parameters&) {
  return JobResponse(
      AddDemonstrationJob(service.engine(), *service.jobs, CollectionOf(service, request)));
}

Parameter ObjectFromParameter(const char* meaning) {
  return Parameter("object_from", meaning)
      .Choice({"auto", "folder", "stem", "none"})
      .Default("auto");
}

}  // namespace

void AddImportRoutes(RouteTable& table) {
  table.Add("POST /v1/collections/{c}/images:import", "images.import", Import)
      .Summary(
          "Add many images in the background, from lines of JSON with base64 or a TAR archive; or "
          "change names and labels of stored images by a CSV table")
      .Body(BodyKind::kBulk)
      .Takes(
          {{"object", "object of all images; a line of JSON can name another one"},
           Parameter("metadata", "metadata of all images; a line of JSON can have other metadata")
               .Json(),
           ObjectFromParameter("source of the object's name in a TAR archive; auto: the folder if "
                               "the archive has folders, else the file name")})
      .Receives(ReceiveImport)
      .Answers(202, "the job; its items are the results for each image", "Job")
      .Codes({"missing_parameter"})
      .Example(R"(tar cf - mug.png cup.png | curl -H "Content-Type: application/x-tar" )"
               R"(--data-binary @- "$PLIANT/v1/collections/default/images:import")");
  table.Add("POST /v1/collections/{c}/imports", "imports.create", ImportFolder)
      .Summary("Add the images of a folder on the server, in the background")
      .Needs(Scope::kAdmin)
      .Takes(
          {Parameter("folder", "path below --import-dir; \".\" is the whole directory").Required(),
           ObjectFromParameter("source of the object's name; auto: folder if there are subfolders, "
                               "else stem (the file name)")})
      .Answers(202, "the job; Location has its address", "Job")
      .Codes({"imports_off"})
      .ExampleBody(R"({"folder": "shelf"})");
  table.Add("GET /v1/collections/{c}/demo", "demo.get", GetDemonstration)
      .Summary("List the demonstration objects, and whether the collection has them")
      .Answers(200, "all demonstration objects", "Demo");
  table.Add("POST /v1/collections/{c}/demo", "demo.load", LoadDemonstration)
      .Summary("Add the demonstration objects, in the background")
      .Answers(202, "the job; Location has its address", "Job")
      .Example(R"(curl -X POST "$PLIANT/v1/collections/toys/demo")");
}

}  // namespace pliant::server
