// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Pictures and objects, changed in place: names, labels.
#include "index/json/record_json.h"
#include "index/records/changes.h"
#include "server/http/problem.h"
#include "server/routes/changes.h"
#include "server/routes/objects.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

Response ChangeImage(Service& service, const Request& request) {
  const Json patch = MergePatchOf(request, {"object", "metadata", "source"});
  PictureChange change;
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

void AddChangeRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "images.patch",
       .method = "PATCH",
       .pattern = "/v1/collections/{c}/images/{id}",
       .summary = "Change a picture's object, metadata or source",
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
       .summary = "Rename an object, with all its pictures",
       .scope = Scope::kWrite,
       .body = BodyKind::kMergePatch,
       .body_schema = "ObjectPatch",
       .parameters = {Parameter("merge", "whether the pictures join an object that has the name")
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
