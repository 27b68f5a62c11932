// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Objects: list, show, rename, delete, and locate one in a photo.
#include "descriptor/base/stopwatch.h"
#include "index/json/record_json.h"
#include "index/json/result_json.h"
#include "index/records/records.h"
#include "index/verify/locate.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/lists.h"
#include "server/routes/request_body.h"
#include "server/routes/routes.h"

namespace pliant::server {
namespace {

[[noreturn]] void ThrowNoObject(const std::string& object) {
  throw ProblemError("object_not_found", "No image shows the object '" + object + "'.");
}

// `image_id`: one image of the object; null if empty, as after the last image is deleted.
Json ObjectJson(const ObjectRecord& object, const std::string& image_id) {
  return {{"object", object.object}, {"images", object.images}, {"image_id", TextOrNull(image_id)}};
}

// With the first of its images.
Json ObjectJson(Service& service, const std::string& collection, const ObjectRecord& object) {
  ImageListing first;
  first.which.collection = collection;
  first.which.object = object.object;
  first.limit = 1;
  const std::vector<ImageRecord> images = service.engine().ListPage(first).records;
  return ObjectJson(object, images.empty() ? std::string() : images.front().id);
}

const Choices<ObjectOrder> kObjectOrders = {{"object", ObjectOrder::kName},
                                            {"created", ObjectOrder::kCreated},
                                            {"updated", ObjectOrder::kUpdated},
                                            {"images", ObjectOrder::kImages}};

Response List(Service& service, const Request& request, const Parameters& parameters) {
  return ListAnswer<ObjectListing>(service, request, parameters, "objects", kObjectOrders,
                                   ListedObjectJson);
}

Response Get(Service& service, const Request& request, const Parameters&) {
  const std::string& object = request.captures.at("o");
  const std::string collection = CollectionOf(service, request);
  const auto found = service.engine().GetObject(collection, object);
  if (!found) ThrowNoObject(object);
  return RecordResponse(ObjectJson(service, collection, *found));
}

Response Delete(Service& service, const Request& request, const Parameters&) {
  const std::string& object = request.captures.at("o");
  const std::uint64_t removed = service.engine().RemoveObject(
      request.captures.at("c"), object, [&](const ObjectRecord& now, const std::string& image_id) {
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

Response Patch(Service& service, const Request& request, const Parameters& parameters) {
  const Json patch = MergePatchOf(request, {"object", "collection"});
  const std::string& object = request.captures.at("o");
  ObjectChange change;
  change.collection = TextIn(patch, "collection");
  change.name = TextIn(patch, "object").value_or(object);
  change.merge = parameters.Value<bool>("merge");
  change.check = [&](const ObjectRecord& now, const std::string& image_id) {
    CheckIfMatch(request, ObjectJson(now, image_id));
  };
  const std::string collection = CollectionOf(service, request);
  const ObjectRecord changed = service.engine().ChangeObject(collection, object, change);
  if (change.collection) service.OnAdded(*change.collection);
  return RecordResponse(ObjectJson(service, change.collection.value_or(collection), changed));
}

}  // namespace

void AddObjectRoutes(RouteTable& table) {
  table.Add("GET /v1/collections/{c}/objects", "objects.list", List)
      .Summary("List objects page by page")
      .Takes(ListParameters(NamesOf(kObjectOrders)))
      .Answers(200, "a page", "ObjectList")
      .Example(R"(curl "$PLIANT/v1/collections/default/objects?sort=-images")");
  table.Add("GET /v1/collections/{c}/objects/{o}", "objects.get", Get)
      .Summary("Get one object and its number of images")
      .Answers(200, "the object, with ETag", "Object")
      .AnswersNotModified();
  table.Add("PATCH /v1/collections/{c}/objects/{o}", "objects.patch", Patch)
      .Summary("Rename an object in all its images, or move it with them to another collection")
      .Patches("ObjectPatch")
      .Takes({Parameter("merge", "merge with an existing object of that name")
                  .Boolean()
                  .Default("false")})
      .TakesIfMatch()
      .Answers(200, "the object after the change", "Object")
      .Codes({"object_exists", "image_exists"})
      .ExampleBody(R"({"object": "tea mug"})");
  table.Add("DELETE /v1/collections/{c}/objects/{o}", "objects.delete", Delete)
      .Summary("Delete all images of an object")
      .TakesIfMatch()
      .Answers(200, "the number of deleted images", "ObjectDeleted");
  table.Add("POST /v1/collections/{c}/objects/{o}/locate", "objects.locate", Locate)
      .Summary("Locate the object in the uploaded photo")
      .Needs(Scope::kRead)
      .Body(BodyKind::kImageOrJson)
      .Answers(200, "the outline, or that the photo does not show the object", "Location")
      .Codes({"part_unavailable"})
      .Example(R"(-F image=@mug.png)");
}

}  // namespace pliant::server
