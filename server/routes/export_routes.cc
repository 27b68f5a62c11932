// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// All records of a collection at once, a line each, and all features.
#include <atomic>
#include <filesystem>

#include "index/engine/collection_npz.h"
#include "index/json/record_json.h"
#include "index/store/database_url.h"
#include "server/http/body_file.h"
#include "server/http/problem.h"
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

std::atomic<int> running{0};

std::shared_ptr<BodyFile> NewFile(Service& service) {
  const EngineOptions& engine = service.options.engine;
  return std::make_shared<BodyFile>(FolderOf(engine.database), engine.reserve_bytes);
}

Response Attachment(std::shared_ptr<const BodyFile> file, const char* type,
                    const std::string& name) {
  Response response;
  response.content_type = type;
  response.file = std::move(file);
  response.headers.emplace_back("Cache-Control", "no-store");
  response.headers.emplace_back("Content-Disposition", "attachment; filename=\"" + name + "\"");
  return response;
}

Response Export(Service& service, const Request& request, const Parameters& parameters) {
  const Turn turn(running);
  ImageListing list;
  list.which = SelectionOf(parameters, CollectionOf(service, request));
  list.limit = kRecordsAtOnce;
  const std::shared_ptr<BodyFile> file = NewFile(service);
  service.engine().ForEachPage(list, [&](const ImagePage& page) {
    std::string lines;
    for (const ImageRecord& record : page.records) lines += ToText(ImageJson(record)) + '\n';
    if (!lines.empty()) file->Append(lines);
  });
  return Attachment(file, kNdjsonType, list.which.collection + ".ndjson");
}

Response ExportFeatures(Service& service, const Request& request, const Parameters& parameters) {
  const Turn turn(running);
  ImageListing list;
  list.which = SelectionOf(parameters, CollectionOf(service, request));
  const std::shared_ptr<BodyFile> file = NewFile(service);
  WriteFeaturesNpz(
      service.engine(), list, [&](std::uint64_t bytes) { file->Reserve(bytes); },
      [&](std::uint64_t offset, std::string_view bytes) { file->Write(offset, bytes); });
  return Attachment(file, kNpzType, list.which.collection + ".npz");
}

}  // namespace

void AddExportRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "collections.export",
       .method = "GET",
       .pattern = "/v1/collections/{c}/export",
       .summary =
           "All records of a collection, or some, in order of their ids: a line of JSON each",
       .parameters = {{"object", "only images of this object"}, FilterParameter(), TextParameter()},
       .answers = {{200, "lines, each an Image", "", kNdjsonType}},
       .codes = {"busy", "no_space", "read_only"},
       .example = R"(curl "$PLIANT/v1/collections/default/export")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return Export(service, request, parameters);
       }});
  routes.push_back(
      {.name = "collections.features",
       .method = "GET",
       .pattern = "/v1/collections/{c}/features",
       .summary = "The features of a collection, or some, in order of their ids: NumPy's archive",
       .parameters = {Parameter("format", "npz: for numpy.load").Choice({"npz"}).Default("npz"),
                      {"object", "only images of this object"},
                      FilterParameter(),
                      TextParameter()},
       .answers = {{200,
                    "arrays keypoints, descriptors, starts, names (ids), objects, width, height, "
                    "model_id",
                    "", kNpzType}},
       .codes = {"busy", "no_space", "read_only"},
       .example = R"(curl -o features.npz "$PLIANT/v1/collections/default/features")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return ExportFeatures(service, request, parameters);
       }});
}

}  // namespace pliant::server
