// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Objects: what images show, and where one is in an image.
#include "descriptor/base/stopwatch.h"
#include "index/json/record_json.h"
#include "index/json/result_json.h"
#include "index/records/records.h"
#include "index/verify/locate.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/changes.h"
#include "server/routes/lists.h"
#include "server/routes/objects.h"
#include "server/routes/routes.h"
#include "server/routes/uploaded_image.h"

namespace pliant::server {
namespace {

[[noreturn]] void ThrowNoObject(const std::string& object) {
  throw ProblemError("object_not_found", "There is no image of an object '" + object + "'.");
}

const Orders<ObjectOrder>& ObjectOrders() {
  static const Orders<ObjectOrder> orders = {{"object", ObjectOrder::kName},
                                             {"created", ObjectOrder::kCreated},
                                             {"updated", ObjectOrder::kUpdated},
                                             {"images", ObjectOrder::kImages}};
  return orders;
}

Response List(Service& service, const Request& request, const Parameters& parameters) {
  ObjectListing list;
  list.which = SelectionOf(parameters, CollectionOf(service, request));
  const std::string identity = ListIdentity("objects", list.which, parameters);
  static_cast<PageOptions&>(list) = PageOptionsOf(parameters, identity);
  list.order = OrderOf(parameters, ObjectOrders());
  const ObjectPage page = ListPageOf(service.engine(), list);
  Json items = Json::array();
  for (const ListedObject& object : page.records) items.push_back(ListedObjectJson(object));
  return JsonResponse(PageJson("objects", std::move(items), page.next, page.total, page.facets,
                               parameters, identity));
}

Response Get(Service& service, const Request& request) {
  const std::string& object = request.captures.at("o");
  const std::string collection = CollectionOf(service, request);
  const auto found = service.engine().GetObject(collection, object);
  if (!found) ThrowNoObject(object);
  return RecordResponse(ObjectJson(service, collection, *found));
}

Response Remove(Service& service, const Request& request) {
  const std::string& object = request.captures.at("o");
  const std::uint64_t removed =
      service.engine().RemoveObject(CollectionOf(service, request), object,
                                    [&](const ObjectRecord& now, const std::string& image_id) {
                                      CheckConditionsOf(request, ObjectJson(now, image_id));
                                    });
  if (removed == 0) ThrowNoObject(object);
  return JsonResponse({{"object", object}, {"deleted", removed}});
}

Response Locate(Service& service, const Request& request, const Parameters& parameters) {
  const Stopwatch watch;
  const UploadedImage image = ImageOf(request, parameters, service.fetcher);
  ObjectLocation found;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int cores) {
    found = service.engine().Locate(image.bytes, CollectionOf(service, request),
                                    request.captures.at("o"), cores);
  });
  Json json = {{"object", found.object},       {"image_id", found.image_id},
               {"took_ms", watch.ms()},        {"width", found.query_width},
               {"height", found.query_height}, {"compared", found.compared}};
  json.update(LocationJson(found.location));
  return JsonResponse(json);
}

Response ChangeImage(Service& service, const Request& request) {
  const Json patch = MergePatchOf(request, {"object", "metadata", "source"});
  ImageChange change;
  change.object = TextIn(patch, "object");
  change.source = TextIn(patch, "source");
  if (const auto it = patch.find("metadata"); it != patch.end()) {
    if (!it->is_object() && !it->is_null()) {
      ThrowInvalid("metadata", "metadata must be an object of keys to set, or null.");
    }
    change.metadata = ToText(*it);
  }
  change.check = [&](const ImageRecord& now) { CheckIfMatch(request, ImageJson(now)); };
  return RecordResponse(ImageJson(
      service.engine().Change(CollectionOf(service, request), request.captures.at("id"), change)));
}

Response ChangeObject(Service& service, const Request& request, const Parameters& parameters) {
  const Json patch = MergePatchOf(request, {"object"});
  if (!patch.contains("object")) {
    throw ProblemError("missing_parameter", "object is required: the new name.")
        .Parameter("object");
  }
  const Json& name = patch["object"];
  if (!name.is_string() || name.get<std::string>().empty()) {
    ThrowInvalid("object", "object must be text, and not empty.");
  }
  ObjectChange change;
  change.name = name.get<std::string>();
  change.merge = parameters.Flag("merge").value_or(false);
  change.check = [&](const ObjectRecord& now, const std::string& image_id) {
    CheckIfMatch(request, ObjectJson(now, image_id));
  };
  const std::string& collection = CollectionOf(service, request);
  const ObjectRecord changed =
      service.engine().ChangeObject(collection, request.captures.at("o"), change);
  return RecordResponse(ObjectJson(service, collection, changed));
}

}  // namespace

Json ObjectJson(const ObjectRecord& object, const std::string& image_id) {
  return {{"object", object.object},
          {"images", object.images},
          {"image_id", image_id.empty() ? Json(nullptr) : Json(image_id)}};
}

Json ObjectJson(Service& service, const std::string& collection, const ObjectRecord& object) {
  ListOptions first;
  first.collection = collection;
  first.object = object.object;
  first.limit = 1;
  const std::vector<ImageRecord> images = service.engine().List(first);
  return ObjectJson(object, images.empty() ? std::string() : images.front().id);
}

void AddObjectRoutes(Service& service, std::vector<Route>& routes) {
  std::vector<Parameter> listing = ListParameters(NamesOf(ObjectOrders()));
  listing.push_back(CursorParameter());
  listing.push_back(LimitParameter());
  routes.push_back({.name = "objects.list",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/objects",
                    .summary = "Objects, page by page: some or all, in the order asked for",
                    .parameters = std::move(listing),
                    .answers = {{200, "a page", "ObjectList"}},
                    .example = R"(curl "$PLIANT/v1/collections/default/objects?sort=-images")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return List(service, request, parameters);
                    }});
  routes.push_back({.name = "objects.get",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/objects/{o}",
                    .summary = "One object: how many images show it",
                    .answers = {{200, "the object, with ETag", "Object"},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .codes = {"object_not_found"},
                    .example = R"(curl "$PLIANT/v1/collections/default/objects/mug")",
                    .handler = [&service](const Request& request, const Parameters&) {
                      return Get(service, request);
                    }});
  routes.push_back({.name = "objects.locate",
                    .method = "POST",
                    .pattern = "/v1/collections/{c}/objects/{o}/locate",
                    .summary = "Where the object is in the image sent",
                    .body = BodyKind::kImageOrJson,
                    .answers = {{200, "where, or that it is not found", "Location"}},
                    .codes = {"object_not_found"},
                    .example = R"(curl -F image=@mug.png )"
                               R"("$PLIANT/v1/collections/default/objects/mug/locate")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Locate(service, request, parameters);
                    }});
  routes.push_back({.name = "objects.delete",
                    .method = "DELETE",
                    .pattern = "/v1/collections/{c}/objects/{o}",
                    .summary = "Delete all images of an object",
                    .scope = Scope::kWrite,
                    .answers = {{200, "how many are gone", "ObjectDeleted"}},
                    .codes = {"object_not_found"},
                    .example = R"(curl -X DELETE "$PLIANT/v1/collections/default/objects/mug")",
                    .handler = [&service](const Request& request,
                                          const Parameters&) { return Remove(service, request); },
                    .takes_if_match = true});
}

void AddChangeRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "images.patch",
       .method = "PATCH",
       .pattern = "/v1/collections/{c}/images/{id}",
       .summary = "Change an image's object, metadata or source",
       .scope = Scope::kWrite,
       .body = BodyKind::kMergePatch,
       .body_schema = "ImagePatch",
       .answers = {{200, "the record as it is now", "Image"}},
       .codes = {"image_not_found"},
       .example = R"(curl -X PATCH -H "Content-Type: application/merge-patch+json" )"
                  R"(-d '{"metadata": {"shelf": 5}}' )"
                  R"("$PLIANT/v1/collections/default/images/$IMAGE")",
       .handler = [&service](const Request& request,
                             const Parameters&) { return ChangeImage(service, request); },
       .takes_if_match = true});
  routes.push_back(
      {.name = "objects.patch",
       .method = "PATCH",
       .pattern = "/v1/collections/{c}/objects/{o}",
       .summary = "Rename an object, with all its images",
       .scope = Scope::kWrite,
       .body = BodyKind::kMergePatch,
       .body_schema = "ObjectPatch",
       .parameters = {Parameter("merge", "whether the images join an object that has the name")
                          .Boolean()
                          .Default("false")},
       .answers = {{200, "the object as it is now", "Object"}},
       .codes = {"object_not_found", "object_exists"},
       .example = R"(curl -X PATCH -H "Content-Type: application/merge-patch+json" )"
                  R"(-d '{"object": "tea mug"}' "$PLIANT/v1/collections/default/objects/mug")",
       .handler =
           [&service](const Request& request, const Parameters& parameters) {
             return ChangeObject(service, request, parameters);
           },
       .takes_if_match = true});
}

}  // namespace pliant::server
