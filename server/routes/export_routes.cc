// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// All records of a collection at once, a line each.
#include <atomic>
#include <filesystem>

#include "index/store/cluster_scheme.h"
#include "server/http/body_file.h"
#include "server/http/problem.h"
#include "server/routes/common.h"
#include "server/routes/lists.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

constexpr int kRecordsAtOnce = 500;  // in memory
constexpr int kMostAtOnce = 4;       // exports that are being written

// Counts the exports that are being written, for as long as one is.
class Turn {
 public:
  explicit Turn(std::atomic<int>& running) : running_(running) {
    if (++running_ <= kMostAtOnce) return;
    --running_;
    throw ProblemError("busy", "Other exports are being written. Try again shortly.").RetryAfter(5);
  }
  ~Turn() { --running_; }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  std::atomic<int>& running_;
};

Response Export(Service& service, const Request& request, const Parameters& parameters) {
  static std::atomic<int> running{0};
  const Turn turn(running);
  PictureListing list;
  list.which = SelectionOf(parameters, CollectionOf(service, request));
  list.limit = kRecordsAtOnce;
  const EngineOptions& engine = service.options.engine;
  auto file = std::make_shared<BodyFile>(FolderOf(engine.database), engine.reserve_bytes);
  service.engine().ForEachPage(list, [&](const PicturePage& page) {
    std::string lines;
    for (const ImageRecord& record : page.records) lines += ToText(ImageJson(record)) + '\n';
    if (!lines.empty()) file->Append(lines);
  });
  Response response;
  response.content_type = kNdjsonType;
  response.file = std::move(file);
  response.headers.emplace_back("Cache-Control", "no-store");
  response.headers.emplace_back("Content-Disposition",
                                "attachment; filename=\"" + list.which.collection + ".ndjson\"");
  return response;
}

}  // namespace

void AddExportRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "collections.export",
       .method = "GET",
       .pattern = "/v1/collections/{c}/export",
       .summary =
           "All records of a collection, or some, in order of their ids: a line of JSON each",
       .parameters = {{"object", "only pictures of this object"},
                      FilterParameter(),
                      TextParameter()},
       .answers = {{200, "lines, each an Image", "", kNdjsonType}},
       .codes = {"busy", "no_space", "read_only"},
       .example = R"(curl "$PLIANT/v1/collections/default/export")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return Export(service, request, parameters);
       }});
}

}  // namespace pliant::server
