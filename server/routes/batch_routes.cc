// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Many pictures at once: in one request, or from a folder on the server.
#include <algorithm>
#include <map>
#include <optional>

#include "descriptor/base/parallel.h"
#include "index/json/record_json.h"
#include "server/http/problem.h"
#include "server/jobs/import_job.h"
#include "server/routes/adding.h"
#include "server/routes/common.h"
#include "server/routes/item_result.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

// What is said of one picture of a batch; what is absent is said of all.
struct Item {
  std::optional<std::string> id;
  std::optional<std::string> object;
  std::optional<std::string> metadata;
};

std::optional<std::string> ItemText(const Json& item, const char* name) {
  const auto found = item.find(name);
  if (found == item.end() || found->is_null()) return std::nullopt;
  if (!found->is_string()) ThrowInvalid("items", std::string("items: ") + name + " must be text.");
  return found->get<std::string>();
}

std::vector<Item> ItemsOf(const Parameters& parameters, std::size_t pictures) {
  std::vector<Item> items(pictures);
  const auto list = parameters.JsonList("items");
  if (!list) return items;
  if (list->size() != pictures) {
    ThrowInvalid("items", "items has " + std::to_string(list->size()) + " entries for " +
                              std::to_string(pictures) + " pictures.");
  }
  for (std::size_t i = 0; i < pictures; ++i) {
    const Json& item = (*list)[i];
    if (!item.is_object()) ThrowInvalid("items", "items must hold objects.");
    for (const auto& [name, value] : item.items()) {
      if (name != "id" && name != "object" && name != "metadata") {
        ThrowInvalid("items", "items: there is no '" + name.substr(0, 64) +
                                  "', only id, object and metadata.");
      }
    }
    items[i] = {ItemText(item, "id"), ItemText(item, "object"), std::nullopt};
    if (const auto metadata = item.find("metadata"); metadata != item.end()) {
      if (!metadata->is_object()) ThrowInvalid("items", "items: metadata must be an object.");
      items[i].metadata = ToText(*metadata);
    }
  }
  return items;
}

// One picture's part of the answer. Whatever goes wrong with it concerns no other.
Json ResultOf(Service& service, const AddRequest& add) {
  return ItemResult([&]() -> Json {
    const AddResult added = AddOnPool(service, add);
    return {{"status", added.outcome == AddOutcome::kCreated ? 201 : 200},
            {"outcome", OutcomeName(added.outcome)},
            {"image", ImageJson(added.image)}};
  });
}

Response AddBatch(Service& service, const Request& request, const Parameters& parameters) {
  const std::string collection = CollectionOf(service, request);
  const std::vector<UploadedImage> images = ImagesOf(request);
  const std::vector<Item> items = ItemsOf(parameters, images.size());
  const std::string object = parameters.Text("object").value_or("");
  const std::string metadata = parameters.JsonObject("metadata").value_or("{}");
  std::vector<Json> results(images.size());
  // As many at once as there are cores: one picture a core is faster than all cores a picture.
  ParallelFor(images.size(), service.pool.cores(), [&](std::size_t i) {
    AddRequest add;
    add.collection = collection;
    add.id = items[i].id;
    add.object = items[i].object.value_or(object);
    add.metadata = items[i].metadata.value_or(metadata);
    add.source = images[i].filename;
    add.bytes = images[i].bytes;
    results[i] = ResultOf(service, add);
  });
  std::map<std::string, int> counts = {
      {"created", 0}, {"replaced", 0}, {"unchanged", 0}, {"failed", 0}};
  Json list = Json::array();
  for (std::size_t i = 0; i < results.size(); ++i) {
    ++counts[results[i].value("outcome", "failed")];
    Json entry = {{"index", i}, {"source", images[i].filename}};
    entry.update(results[i]);
    list.push_back(std::move(entry));
  }
  Json answer = Json::object();
  for (const char* name : {"created", "replaced", "unchanged", "failed"})
    answer[name] = counts[name];
  answer["results"] = std::move(list);
  Response response = JsonResponse(answer, 207);
  response.unfinished = std::any_of(results.begin(), results.end(), [](const Json& result) {
    return result.at("status").get<int>() >= 500;
  });
  return response;
}

Response Import(Service& service, const Request& request, const Parameters& parameters) {
  const CollectionRecord collection =
      service.engine().GetCollection(CollectionOf(service, request));
  const std::string folder = parameters.Text("folder").value_or("");
  ResolveImportFolder(service.options.import_dir, folder);  // says now what is wrong with it
  return JobResponse(AddImportJob(*service.jobs, collection, folder,
                                  parameters.Text("object_from").value_or("auto")));
}

}  // namespace

void AddBatchRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "images.batch",
       .method = "POST",
       .pattern = "/v1/collections/{c}/images:batch",
       .summary = "Add many pictures; each has a result of its own, and a bad one harms no other",
       .scope = Scope::kWrite,
       .body = BodyKind::kImages,
       .parameters = {ObjectParameter(), MetadataParameter(),
                      Parameter("items",
                                "one object for each picture, in their order: {id, object, "
                                "metadata}, where they differ")
                          .JsonList()},
       .answers = {{207, "a result for each picture, in their order", "BatchAnswer"}},
       .codes = {"missing_parameter"},
       .example = R"(curl -F image=@mug.png -F image=@cup.png )"
                  R"(-F 'items=[{"object": "mug"}, {"id": "cup-1", "object": "cup"}]' )"
                  R"("$PLIANT/v1/collections/default/images:batch")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return AddBatch(service, request, parameters);
       }});
  routes.push_back(
      {.name = "imports.create",
       .method = "POST",
       .pattern = "/v1/collections/{c}/imports",
       .summary = "Add the pictures of a folder on the server, in the background",
       .scope = Scope::kAdmin,
       .body = BodyKind::kJson,
       .parameters =
           {Parameter("folder", "path inside --import-dir; \".\" is all of it").Required(),
            Parameter("object_from",
                      "what names a picture's object; auto: stem for a folder without "
                      "folders, else folder")
                .Choice({"auto", "folder", "stem", "none"})
                .Default("auto")},
       .answers = {{202, "the job; Location has its address", "Job"}},
       .codes = {"imports_off"},
       .example = R"(curl -H "Content-Type: application/json" -d '{"folder": "shelf"}' )"
                  R"("$PLIANT/v1/collections/default/imports")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return Import(service, request, parameters);
       }});
}

}  // namespace pliant::server
