// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Backups while the server runs, into the operator's directory.
#include "index/json/record_json.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Json BackupJson(const BackupFile& file) {
  return {{"name", file.name}, {"bytes", file.bytes}, {"created_at", IsoTime(file.created_ms)}};
}

Response List(Service& service) {
  Json items = Json::array();
  for (const BackupFile& file : service.backups.List()) items.push_back(BackupJson(file));
  return JsonResponse({{"backups", items}});
}

Response Content(Service& service, const Request& request) {
  const std::string& name = request.captures.at("b");
  Response response;
  response.file = service.backups.Content(name);
  response.content_type = kFileType;
  response.headers.emplace_back("ETag", '"' + response.file->version() + '"');
  response.headers.emplace_back("Accept-Ranges", "bytes");
  response.headers.emplace_back("Cache-Control", "no-store");
  response.headers.emplace_back("Content-Disposition", "attachment; filename=\"" + name + "\"");
  return response;
}

void AddBackupFileRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "backups.content",
                    .method = "GET",
                    .pattern = "/v1/backups/{b}/content",
                    .summary = "Download a backup: the database file, or a part of it",
                    .scope = Scope::kAdmin,
                    .answers = {{200, "the file, with ETag", "", kFileType},
                                {206, "the part that Range asks for", "", kFileType},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .codes = {"backups_off", "backup_not_found"},
                    .example = R"(curl -o copy.db "$PLIANT/v1/backups/$BACKUP/content")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Content(service, request);
                    }});
  routes.push_back({.name = "backups.delete",
                    .method = "DELETE",
                    .pattern = "/v1/backups/{b}",
                    .summary = "Delete a backup",
                    .scope = Scope::kAdmin,
                    .answers = {{204, "gone", "", ""}},
                    .codes = {"backups_off", "backup_not_found"},
                    .example = R"(curl -X DELETE "$PLIANT/v1/backups/$BACKUP")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      service.backups.Remove(request.captures.at("b"));
                      return Response{.status = 204};
                    }});
}

}  // namespace

void AddBackupRoutes(Service& service, std::vector<Route>& routes) {
  AddBackupFileRoutes(service, routes);
  routes.push_back(
      {.name = "backups.create",
       .method = "POST",
       .pattern = "/v1/backups",
       .summary = "Copy the database, while it is in use, to a file in --backup-dir",
       .scope = Scope::kAdmin,
       .body = BodyKind::kJson,
       .parameters = {{"name", "of the file, ending in .db; by default made from the time"}},
       .answers = {{202, "the job; Location has its address", "Job"}},
       .codes = {"backups_off", "backup_exists"},
       .example = R"(curl -X POST "$PLIANT/v1/backups")",
       .handler = [&service](const Request&, const Parameters& parameters) {
         return JobResponse(
             service.backups.Add(*service.jobs, parameters.Text("name").value_or("")));
       }});
  routes.push_back(
      {.name = "backups.list",
       .method = "GET",
       .pattern = "/v1/backups",
       .summary = "The backups in --backup-dir, newest first",
       .scope = Scope::kAdmin,
       .answers = {{200, "all of them", "BackupList"}},
       .codes = {"backups_off"},
       .example = R"(curl "$PLIANT/v1/backups")",
       .handler = [&service](const Request&, const Parameters&) { return List(service); }});
  routes.push_back({.name = "backups.get",
                    .method = "GET",
                    .pattern = "/v1/backups/{b}",
                    .summary = "One backup: how large, since when",
                    .scope = Scope::kAdmin,
                    .answers = {{200, "the backup", "Backup"}},
                    .codes = {"backups_off", "backup_not_found"},
                    .example = R"(curl "$PLIANT/v1/backups/$BACKUP")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return JsonResponse(
                          BackupJson(service.backups.Get(request.captures.at("b"))));
                    }});
}

}  // namespace pliant::server
