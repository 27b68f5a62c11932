// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// All records of a collection as lines of JSON, and all features as an archive for NumPy.
#include <atomic>

#include "index/engine/collection_npz.h"
#include "index/json/record_csv.h"
#include "index/json/record_json.h"
#include "index/store/database_url.h"
#include "server/http/body_file.h"
#include "server/http/problem.h"
#include "server/routes/lists.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

constexpr int kRecordsAtOnce = 500;  // in memory
constexpr int kMostAtOnce = 4;       // exports that the server writes

std::atomic<int> running{0};

// Writes the export to a file that disappears after the answer. Throws ProblemError "busy".
Response Export(Service& service, const Request& request, const Parameters& parameters,
                const char* type, const char* extension,
                const std::function<void(ImageListing&, BodyFile&)>& write) {
  const std::shared_ptr<void> turn(nullptr, [](void*) { --running; });
  if (++running > kMostAtOnce) {
    throw ProblemError("busy", "The server is writing other exports. Try again shortly.",
                       {.retry_after_s = 5});
  }
  ImageListing list;
  list.which = SelectionOf(parameters, CollectionOf(service, request));
  const EngineOptions& engine = service.options.engine;
  const auto file = std::make_shared<BodyFile>(FolderOf(engine.database), engine.reserve_bytes);
  write(list, *file);
  const std::string name = list.which.collection + extension;
  return {.content_type = type,
          .headers = {{"Cache-Control", "no-store"},
                      {"Content-Disposition", "attachment; filename=\"" + name + "\""}},
          .file = file};
}

Response ExportRecords(Service& service, const Request& request, const Parameters& parameters) {
  const bool csv = parameters.Text("format") == "csv";
  return Export(service, request, parameters, csv ? kCsvType : kNdjsonType,
                csv ? ".csv" : ".ndjson", [&](ImageListing& list, BodyFile& file) {
                  if (csv) file.Append(kCsvHeader);
                  list.limit = kRecordsAtOnce;
                  service.engine().ForEachPage(list, [&](const ImagePage& page) {
                    std::string lines;
                    for (const ImageRecord& image : page.records) {
                      lines += csv ? CsvRow(image) : ToText(ImageJson(image)) + '\n';
                    }
                    if (!lines.empty()) file.Append(lines);
                  });
                });
}

Response ExportFeatures(Service& service, const Request& request, const Parameters& parameters) {
  return Export(
      service, request, parameters, kNpzType, ".npz", [&](ImageListing& list, BodyFile& file) {
        WriteFeaturesNpz(
            service.engine(), list, [&](std::uint64_t bytes) { file.Reserve(bytes); },
            [&](std::uint64_t offset, std::string_view bytes) { file.Write(offset, bytes); });
      });
}

}  // namespace

void AddExportRoutes(RouteTable& table) {
  table.Add("GET /v1/collections/{c}/export", "collections.export", ExportRecords)
      .Summary("Export the records of images, as lines of JSON or as a table, ordered by id")
      .Takes({Parameter("format", "ndjson: one JSON object per line; csv: id, object, file, labels")
                  .Choice({"ndjson", "csv"})
                  .Default("ndjson"),
              OfObjectParameter(), FilterParameter(), TextParameter()})
      .Sends(kNdjsonType, "lines, each an Image")
      .Sends(kCsvType, "a table that images:import accepts")
      .Codes({"no_space", "read_only"});
  table.Add("GET /v1/collections/{c}/features", "collections.features", ExportFeatures)
      .Summary("Export the features of images as an archive for NumPy, ordered by id")
      .Takes({Parameter("format", "npz: for numpy.load").Choice({"npz"}).Default("npz"),
              OfObjectParameter(), FilterParameter(), TextParameter()})
      .Sends(kNpzType,
             "arrays keypoints, descriptors, starts, names (ids), objects, width, height, model_id")
      .Codes({"no_space", "read_only"})
      .Example(R"(-o features.npz)");
}

}  // namespace pliant::server
