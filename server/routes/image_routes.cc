// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Pictures: add, replace, show, list, delete.
#include "server/problem.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

AddResult AddOnPool(Service& service, const AddRequest& request) {
  AddResult result;
  service.pool.Run(WorkerPool::Lane::kUpload, [&](int cores) {
    AddRequest with_cores = request;
    with_cores.threads = cores;
    result = service.engine().Add(with_cores);
  });
  if (result.outcome != AddOutcome::kUnchanged && service.auto_trainer() != nullptr) {
    service.auto_trainer()->OnAdded(request.collection);
  }
  return result;
}

Response Add(Service& service, const Request& request, const Parameters& parameters,
             std::optional<std::string> id) {
  const UploadedImage image = ImageOf(request);
  AddRequest add;
  add.collection = CollectionOf(request);
  add.id = std::move(id);
  add.object = parameters.Text("object").value_or("");
  add.metadata = parameters.JsonObject("metadata").value_or("{}");
  add.source = image.filename;
  add.bytes = image.bytes;
  const AddResult result = AddOnPool(service, add);
  const bool created = result.outcome == AddOutcome::kCreated;
  Response response = JsonResponse(ImageJson(result.image), created ? 201 : 200);
  response.headers.emplace_back(created ? "Location" : "Content-Location", ImagePath(result.image));
  return response;
}

Response List(Service& service, const Request& request, const Parameters& parameters) {
  ListOptions list;
  list.collection = CollectionOf(request);
  list.object = parameters.Text("object");
  const int limit =
      static_cast<int>(parameters.Integer("limit", 1, kLargestPage).value_or(kDefaultPage));
  const std::string name = ToText(
      Json::array({"images", list.collection, list.object ? Json(*list.object) : Json(nullptr)}));
  list.after_id = AfterFromCursor(parameters, name);
  list.limit = limit + 1;  // one more tells whether there is a next page
  std::vector<ImageRecord> images = service.engine().List(list);
  const bool more = images.size() > static_cast<std::size_t>(limit);
  if (more) images.resize(static_cast<std::size_t>(limit));
  Json items = Json::array();
  for (const ImageRecord& image : images) items.push_back(ImageJson(image));
  return JsonResponse({{"images", items},
                       {"next", more ? Json(MakeCursor(name, images.back().id)) : Json(nullptr)}});
}

Response Remove(Service& service, const Request& request) {
  const std::string& id = request.captures.at("id");
  if (!service.engine().Remove(CollectionOf(request), id)) {
    throw ProblemError("image_not_found", "There is no picture '" + id + "'.");
  }
  return {.status = 204};
}

}  // namespace

void AddImageRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "images.create",
                    .method = "POST",
                    .pattern = "/v1/collections/{c}/images",
                    .scope = Scope::kWrite,
                    .body = BodyKind::kImage,
                    .parameters = {"id", "object", "metadata"},
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      std::optional<std::string> id = parameters.Text("id");
                      if (id && id->empty()) id.reset();  // a form's field left empty
                      return Add(service, request, parameters, std::move(id));
                    }});
  routes.push_back({.name = "images.put",
                    .method = "PUT",
                    .pattern = "/v1/collections/{c}/images/{id}",
                    .scope = Scope::kWrite,
                    .body = BodyKind::kImage,
                    .parameters = {"object", "metadata"},
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Add(service, request, parameters, request.captures.at("id"));
                    }});
  routes.push_back({.name = "images.list",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images",
                    .parameters = {"object", "cursor", "limit"},
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return List(service, request, parameters);
                    }});
  routes.push_back({.name = "images.get",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images/{id}",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return JsonResponse(ImageJson(
                          service.engine().Get(CollectionOf(request), request.captures.at("id"))));
                    }});
  routes.push_back({.name = "images.delete",
                    .method = "DELETE",
                    .pattern = "/v1/collections/{c}/images/{id}",
                    .scope = Scope::kWrite,
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Remove(service, request);
                    }});
}

}  // namespace pliant::server
