// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Backups into the operator's directory while the server runs.
#include "server/routes/answers.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Json BackupJson(const BackupFile& file) {
  return {{"name", file.name}, {"bytes", file.bytes}, {"created_at", IsoTime(file.created_ms)}};
}

Response Create(Service& service, const Request&, const Parameters& parameters) {
  return JobResponse(service.backups.Add(*service.jobs, parameters.Text("name").value_or("")));
}

Response List(Service& service, const Request&, const Parameters&) {
  Json items = Json::array();
  for (const BackupFile& file : service.backups.List()) items.push_back(BackupJson(file));
  return JsonResponse({{"backups", items}});
}

Response Get(Service& service, const Request& request, const Parameters&) {
  return JsonResponse(BackupJson(service.backups.Get(request.captures.at("b"))));
}

Response Content(Service& service, const Request& request, const Parameters&) {
  const std::string& name = request.captures.at("b");
  const std::shared_ptr<const BodyFile> file = service.backups.Content(name);
  return {.content_type = kFileType,
          .headers = {{"ETag", '"' + file->version() + '"'},
                      {"Accept-Ranges", "bytes"},
                      {"Cache-Control", "no-store"},
                      {"Content-Disposition", "attachment; filename=\"" + name + "\""}},
          .file = file};
}

Response Delete(Service& service, const Request& request, const Parameters&) {
  service.backups.Remove(request.captures.at("b"));
  return {.status = 204};
}

}  // namespace

void AddBackupRoutes(RouteTable& table) {
  table.Add("POST /v1/backups", "backups.create", Create)
      .Summary("Copy the database to a file in --backup-dir while the server runs")
      .Needs(Scope::kAdmin)
      .Takes({{"name", "name of the file, ending in .db; by default made from the time"}})
      .Answers(202, "the job; Location has its address", "Job")
      .Codes({"backup_exists"});
  table.Add("GET /v1/backups", "backups.list", List)
      .Summary("List the backups in --backup-dir, newest first")
      .Needs(Scope::kAdmin)
      .Answers(200, "all backups", "BackupList");
  table.Add("GET /v1/backups/{b}", "backups.get", Get)
      .Summary("Get the size and the time of one backup")
      .Needs(Scope::kAdmin)
      .Answers(200, "the backup", "Backup");
  table.Add("GET /v1/backups/{b}/content", "backups.content", Content)
      .Summary("Download a backup, or a range of its bytes")
      .Needs(Scope::kAdmin)
      .Sends(kFileType, "the file, with ETag")
      .Sends(kFileType, "the bytes that Range asks for", 206)
      .AnswersNotModified()
      .Example(R"(-o copy.db)");
  table.Add("DELETE /v1/backups/{b}", "backups.delete", Delete)
      .Summary("Delete a backup")
      .Needs(Scope::kAdmin)
      .Answers(204, "deleted");
}

}  // namespace pliant::server
