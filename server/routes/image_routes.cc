// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Pictures: add, replace, show, list, delete.
#include <utility>

#include "descriptor/base/sha256.h"
#include "index/json/record_json.h"
#include "server/http/problem.h"
#include "server/routes/adding.h"
#include "server/routes/answers.h"
#include "server/routes/changes.h"
#include "server/routes/lists.h"
#include "server/routes/routes.h"
#include "server/routes/uploaded_image.h"

namespace pliant::server {

namespace {

std::string ImagePath(const ImageRecord& image) {
  return "/v1/collections/" + EncodeSegment(image.collection) + "/images/" +
         EncodeSegment(image.id);
}

// As AddOnPool; "same_bytes" says which picture has the bytes, so that a client can change that
// one.
PictureCheck CheckOf(const Request& request) {
  return [&request](const ImageRecord* now) {
    CheckConditionsOf(request, now == nullptr ? Json(nullptr) : ImageJson(*now));
  };
}

AddResult AddOrSayWhereItIs(Service& service, const AddRequest& add, const PictureCheck& check) {
  try {
    return AddOnPool(service, add, check);
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
  const UploadedImage image = ImageOf(request, parameters, service.fetcher);
  AddRequest add;
  add.collection = CollectionOf(service, request);
  add.id = std::move(id);
  const bool names_one = request.method == "PUT";
  add.object = parameters.Text("object").value_or("");
  add.metadata = parameters.JsonObject("metadata").value_or("{}");
  add.source = image.filename;
  add.bytes = image.bytes;
  const AddResult result =
      AddOrSayWhereItIs(service, add, names_one ? CheckOf(request) : PictureCheck());
  const bool created = result.outcome == AddOutcome::kCreated;
  Response response = JsonResponse(ImageJson(result.image), created ? 201 : 200);
  if (names_one) response.headers.emplace_back("ETag", EtagOf(ImageJson(result.image)));
  response.headers.emplace_back(created ? "Location" : "Content-Location", ImagePath(result.image));
  return response;
}

const Orders<PictureOrder>& PictureOrders() {
  static const Orders<PictureOrder> orders = {{"id", PictureOrder::kId},
                                              {"created", PictureOrder::kCreated},
                                              {"updated", PictureOrder::kUpdated},
                                              {"object", PictureOrder::kObject},
                                              {"source", PictureOrder::kSource}};
  return orders;
}

Response List(Service& service, const Request& request, const Parameters& parameters) {
  PictureListing list;
  list.which = SelectionOf(parameters, CollectionOf(service, request));
  const std::string identity = ListIdentity("images", list.which, parameters);
  static_cast<PageOptions&>(list) = PageOptionsOf(parameters, identity);
  list.order = OrderOf(parameters, PictureOrders());
  const PicturePage page = ListPageOf(service.engine(), list);
  Json items = Json::array();
  for (const ImageRecord& image : page.records) items.push_back(ImageJson(image));
  return JsonResponse(PageJson("images", std::move(items), page.next, page.total, page.facets,
                               parameters, identity));
}

Response RemoveWhere(Service& service, const Request& request, const Parameters& parameters) {
  const Selection which = SelectionOf(parameters, CollectionOf(service, request));
  if (which.filter.empty()) {
    ThrowInvalid("filter",
                 "filter must have a condition: all pictures go with the collection, or with their "
                 "objects.");
  }
  return JsonResponse({{"deleted", service.engine().RemoveWhere(which)}});
}

Response Remove(Service& service, const Request& request) {
  const std::string& id = request.captures.at("id");
  if (!service.engine().Remove(CollectionOf(service, request), id, CheckOf(request))) {
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
       .body = BodyKind::kImageOrJson,
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
                    .body = BodyKind::kImageOrJson,
                    .parameters = {ObjectParameter(), MetadataParameter()},
                    .answers = {{201, "added", "Image"},
                                {200, "replaced, or the same was there: no work", "Image"}},
                    .example = R"(curl -X PUT -H "Content-Type: image/png" )"
                               R"(--data-binary @cup.png )"
                               R"("$PLIANT/v1/collections/default/images/cup-1?object=cup")",
                    .handler =
                        [&service](const Request& request, const Parameters& parameters) {
                          return Add(service, request, parameters, request.captures.at("id"));
                        },
                    .takes_if_match = true});
}

void AddStoredImageRoutes(Service& service, std::vector<Route>& routes) {
  std::vector<Parameter> listing = {{"object", "only pictures of this object"}};
  for (Parameter& parameter : ListParameters(NamesOf(PictureOrders()))) {
    listing.push_back(std::move(parameter));
  }
  listing.push_back(CursorParameter());
  listing.push_back(LimitParameter());
  routes.push_back(
      {.name = "images.list",
       .method = "GET",
       .pattern = "/v1/collections/{c}/images",
       .summary = "Pictures, page by page: some or all, in the order asked for",
       .parameters = std::move(listing),
       .answers = {{200, "a page", "ImageList"}},
       .example = R"(curl "$PLIANT/v1/collections/default/images?limit=10&sort=-created")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return List(service, request, parameters);
       }});
  routes.push_back(
      {.name = "images.delete_where",
       .method = "DELETE",
       .pattern = "/v1/collections/{c}/images",
       .summary = "Delete all pictures whose metadata pass a filter, at once or not at all",
       .scope = Scope::kWrite,
       .parameters =
           {Parameter("filter", "only pictures whose metadata pass; never all").Json().Required(),
            {"object", "only pictures of this object"},
            TextParameter()},
       .answers = {{200, "how many are gone", "ImagesDeleted"}},
       .example = R"(curl -X DELETE -G --data-urlencode 'filter={"batch": 7}' )"
                  R"("$PLIANT/v1/collections/default/images")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return RemoveWhere(service, request, parameters);
       }});
  routes.push_back({.name = "images.get",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images/{id}",
                    .summary = "One picture's record",
                    .answers = {{200, "the record, with ETag", "Image"},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .codes = {"image_not_found"},
                    .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return RecordResponse(ImageJson(service.engine().Get(
                          CollectionOf(service, request), request.captures.at("id"))));
                    }});
  routes.push_back({.name = "images.delete",
                    .method = "DELETE",
                    .pattern = "/v1/collections/{c}/images/{id}",
                    .summary = "Delete a picture; no later answer knows it",
                    .scope = Scope::kWrite,
                    .answers = {{204, "gone", "", ""}},
                    .codes = {"image_not_found"},
                    .example = R"(curl -X DELETE "$PLIANT/v1/collections/default/images/$IMAGE")",
                    .handler = [&service](const Request& request,
                                          const Parameters&) { return Remove(service, request); },
                    .takes_if_match = true});
}

}  // namespace

void AddImageRoutes(Service& service, std::vector<Route>& routes) {
  AddUploadRoutes(service, routes);
  AddStoredImageRoutes(service, routes);
}

}  // namespace pliant::server
