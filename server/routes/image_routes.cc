// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Pictures: add, replace, show, list, delete.
#include <utility>

#include "descriptor/base/sha256.h"
#include "server/http/problem.h"
#include "server/routes/adding.h"
#include "server/routes/changes.h"
#include "server/routes/common.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

// As AddOnPool; "same_bytes" says which picture has the bytes, so that a client can change that
// one.
AddResult AddOrSayWhereItIs(Service& service, const AddRequest& add) {
  try {
    return AddOnPool(service, add);
  } catch (const Error& error) {
    if (error.reason() != "same_bytes") throw;
    Problem problem = CurrentProblem();
    if (auto stored = service.engine().FindBySha256(add.collection, Sha256Hex(add.bytes))) {
      problem.stored = {.image_id = stored->id, .object = stored->object};
    }
    throw ProblemError(std::move(problem));
  }
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
  const AddResult result = AddOrSayWhereItIs(service, add);
  const bool created = result.outcome == AddOutcome::kCreated;
  Response response = JsonResponse(ImageJson(result.image), created ? 201 : 200);
  response.headers.emplace_back(created ? "Location" : "Content-Location", ImagePath(result.image));
  return response;
}

Response List(Service& service, const Request& request, const Parameters& parameters) {
  ListOptions list;
  list.collection = CollectionOf(request);
  list.object = parameters.Text("object");
  const int limit = PageLimit(parameters);
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

void AddUploadRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "images.create",
       .method = "POST",
       .pattern = "/v1/collections/{c}/images",
       .summary = "Add a picture; the same bytes again are no work",
       .scope = Scope::kWrite,
       .body = BodyKind::kImage,
       .parameters = {{"id", "id of the picture; by default made from its bytes"},
                      ObjectParameter(),
                      MetadataParameter()},
       .answers = {{201, "added", "Image"}, {200, "the same bytes were there: no work", "Image"}},
       .example = R"(curl -F image=@mug.png -F object=mug )"
                  R"("$PLIANT/v1/collections/default/images")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         std::optional<std::string> id = parameters.Text("id");
         if (id && id->empty()) id.reset();  // a form's field left empty
         return Add(service, request, parameters, std::move(id));
       }});
  routes.push_back({.name = "images.put",
                    .method = "PUT",
                    .pattern = "/v1/collections/{c}/images/{id}",
                    .summary = "Add or replace the picture of this id",
                    .scope = Scope::kWrite,
                    .body = BodyKind::kImage,
                    .parameters = {ObjectParameter(), MetadataParameter()},
                    .answers = {{201, "added", "Image"},
                                {200, "replaced, or the same was there: no work", "Image"}},
                    .example = R"(curl -X PUT -H "Content-Type: image/png" )"
                               R"(--data-binary @cup.png )"
                               R"("$PLIANT/v1/collections/default/images/cup-1?object=cup")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Add(service, request, parameters, request.captures.at("id"));
                    }});
}

void AddStoredImageRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "images.list",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images",
                    .summary = "Pictures in order of their ids, page by page",
                    .parameters = {{"object", "only pictures of this object"},
                                   CursorParameter(),
                                   LimitParameter()},
                    .answers = {{200, "a page", "ImageList"}},
                    .example = R"(curl "$PLIANT/v1/collections/default/images?limit=10")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return List(service, request, parameters);
                    }});
  routes.push_back({.name = "images.get",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images/{id}",
                    .summary = "One picture's record",
                    .answers = {{200, "the record", "Image"}},
                    .codes = {"image_not_found"},
                    .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return RecordResponse(ImageJson(
                          service.engine().Get(CollectionOf(request), request.captures.at("id"))));
                    }});
  routes.push_back({.name = "images.delete",
                    .method = "DELETE",
                    .pattern = "/v1/collections/{c}/images/{id}",
                    .summary = "Delete a picture; no later answer knows it",
                    .scope = Scope::kWrite,
                    .answers = {{204, "gone", "", ""}},
                    .codes = {"image_not_found"},
                    .example = R"(curl -X DELETE "$PLIANT/v1/collections/default/images/$IMAGE")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Remove(service, request);
                    }});
}

}  // namespace

void AddImageRoutes(Service& service, std::vector<Route>& routes) {
  AddUploadRoutes(service, routes);
  AddStoredImageRoutes(service, routes);
}

}  // namespace pliant::server
