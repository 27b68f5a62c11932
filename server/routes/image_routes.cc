// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images: add, replace, show, list, delete.
#include <utility>

#include "descriptor/base/base64.h"
#include "descriptor/base/sha256.h"
#include "index/files/features_npz.h"
#include "index/json/record_json.h"
#include "server/http/conditions.h"
#include "server/http/json.h"
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

// As AddOnPool; "same_bytes" says which image has the bytes, so that a client can change that
// one.
ImageCheck CheckOf(const Request& request) {
  return [&request](const ImageRecord* now) {
    CheckConditionsOf(request, now == nullptr ? Json(nullptr) : ImageJson(*now));
  };
}

AddResult AddOrSayWhereItIs(Service& service, const AddRequest& add, const ImageCheck& check) {
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
      AddOrSayWhereItIs(service, add, names_one ? CheckOf(request) : ImageCheck());
  const bool created = result.outcome == AddOutcome::kCreated;
  Response response = JsonResponse(ImageJson(result.image), created ? 201 : 200);
  if (names_one) response.headers.emplace_back("ETag", EtagOf(ImageJson(result.image)));
  response.headers.emplace_back(created ? "Location" : "Content-Location", ImagePath(result.image));
  return response;
}

const Orders<ImageOrder>& ImageOrders() {
  static const Orders<ImageOrder> orders = {{"id", ImageOrder::kId},
                                            {"created", ImageOrder::kCreated},
                                            {"updated", ImageOrder::kUpdated},
                                            {"object", ImageOrder::kObject},
                                            {"source", ImageOrder::kSource}};
  return orders;
}

Response List(Service& service, const Request& request, const Parameters& parameters) {
  ImageListing list;
  list.which = SelectionOf(parameters, CollectionOf(service, request));
  const std::string identity = ListIdentity("images", list.which, parameters);
  static_cast<PageOptions&>(list) = PageOptionsOf(parameters, identity);
  list.order = OrderOf(parameters, ImageOrders());
  const ImagePage page = ListPageOf(service.engine(), list);
  Json items = Json::array();
  for (const ImageRecord& image : page.records) items.push_back(ImageJson(image));
  return JsonResponse(PageJson("images", std::move(items), page.next, page.total, page.facets,
                               parameters, identity));
}

Response RemoveWhere(Service& service, const Request& request, const Parameters& parameters) {
  const Selection which = SelectionOf(parameters, CollectionOf(service, request));
  if (which.filter.empty()) {
    ThrowInvalid("filter",
                 "filter must have a condition: all images go with the collection, or with their "
                 "objects.");
  }
  return JsonResponse({{"deleted", service.engine().RemoveWhere(which)}});
}

Response Remove(Service& service, const Request& request) {
  const std::string& id = request.captures.at("id");
  if (!service.engine().Remove(CollectionOf(service, request), id, CheckOf(request))) {
    throw ProblemError("image_not_found", "There is no image '" + id + "'.");
  }
  return {.status = 204};
}

void AddUploadRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back(
      {.name = "images.create",
       .method = "POST",
       .pattern = "/v1/collections/{c}/images",
       .summary = "Add an image; the same bytes again are no work",
       .scope = Scope::kWrite,
       .body = BodyKind::kImageOrJson,
       .parameters = {{"id", "id of the image; by default made from its bytes"},
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
                    .summary = "Add or replace the image of this id",
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
  std::vector<Parameter> listing = {{"object", "only images of this object"}};
  for (Parameter& parameter : ListParameters(NamesOf(ImageOrders()))) {
    listing.push_back(std::move(parameter));
  }
  listing.push_back(CursorParameter());
  listing.push_back(LimitParameter());
  routes.push_back(
      {.name = "images.list",
       .method = "GET",
       .pattern = "/v1/collections/{c}/images",
       .summary = "Images, page by page: some or all, in the order asked for",
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
       .summary = "Delete all images whose metadata pass a filter, at once or not at all",
       .scope = Scope::kWrite,
       .parameters =
           {Parameter("filter", "only images whose metadata pass; never all").Json().Required(),
            {"object", "only images of this object"},
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
                    .summary = "One image's record",
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
                    .summary = "Delete an image; no later answer knows it",
                    .scope = Scope::kWrite,
                    .answers = {{204, "gone", "", ""}},
                    .codes = {"image_not_found"},
                    .example = R"(curl -X DELETE "$PLIANT/v1/collections/default/images/$IMAGE")",
                    .handler = [&service](const Request& request,
                                          const Parameters&) { return Remove(service, request); },
                    .takes_if_match = true});
}

// Images come from strangers: whatever their bytes are, a browser must not run them. Who names
// the bytes may keep them: at that address they are never others. Another key may not see them.
void AddImageHeaders(Response& response, const std::string& etag, const ImageRecord& image,
                     const Parameters& parameters) {
  const bool named = parameters.Text("sha256") == image.sha256;
  response.headers.emplace_back("ETag", etag);
  response.headers.emplace_back(
      "Cache-Control", named ? "private, max-age=31536000, immutable" : "private, no-cache");
  response.headers.emplace_back("Vary", "Authorization, X-API-Key");
  response.headers.emplace_back("Content-Security-Policy", "default-src 'none'; sandbox");
}

Response Content(Service& service, const Request& request, const Parameters& parameters) {
  const std::string collection = CollectionOf(service, request);
  const ImageRecord image = service.engine().Get(collection, request.captures.at("id"));
  Response response;
  AddImageHeaders(response, '"' + image.sha256 + '"', image, parameters);
  response.headers.emplace_back("Accept-Ranges", "bytes");
  if (!NamedByIfNoneMatch(request, '"' + image.sha256 + '"').empty()) {
    response.status = 304;
    return response;
  }
  const auto bytes = service.engine().GetContent(collection, image.id);
  response.body.assign(bytes.begin(), bytes.end());
  response.content_type =
      image.media_type.starts_with("image/") ? image.media_type : "application/octet-stream";
  return response;
}

Response Thumbnail(Service& service, const Request& request, const Parameters& parameters) {
  const std::string collection = CollectionOf(service, request);
  const ImageRecord image = service.engine().Get(collection, request.captures.at("id"));
  const std::string etag = "\"" + image.sha256 + "-" + std::to_string(kThumbnailSidePx) + "\"";
  Response response;
  AddImageHeaders(response, etag, image, parameters);
  if (!NamedByIfNoneMatch(request, etag).empty()) {
    response.status = 304;
    return response;
  }
  std::shared_ptr<const std::string> jpeg = service.thumbnails.Find(image.sha256);
  if (!jpeg) {
    const std::vector<std::uint8_t> original = service.engine().GetContent(collection, image.id);
    service.pool.Run(WorkerPool::Lane::kSearch, [&](int) {
      jpeg = std::make_shared<const std::string>(
          MakeThumbnail(original, service.options.engine.extraction.decode, service.decode()));
    });
    service.thumbnails.Insert(image.sha256, jpeg);
  }
  response.content_type = "image/jpeg";
  response.body = *jpeg;
  return response;
}

// Descriptors row by row, little-endian; base64 keeps them exact and a third of the size of
// decimal numbers.
Response FeaturesOf(Service& service, const Request& request, const Parameters& parameters) {
  const Features features =
      service.engine().GetFeatures(CollectionOf(service, request), request.captures.at("id"));
  if (parameters.Text("format").value_or("json") == "npz") {
    Response response;
    response.content_type = kNpzType;
    response.body = FeaturesNpz(features);
    response.headers.emplace_back("Cache-Control", "no-store");
    response.headers.emplace_back("Content-Disposition",
                                  "attachment; filename=\"" + request.captures.at("id") + ".npz\"");
    return response;
  }
  Json keypoints = Json::array();
  for (const Keypoint& point : features.keypoints) {
    keypoints.push_back({{"x", point.x},
                         {"y", point.y},
                         {"size", point.size},
                         {"angle", point.angle},
                         {"response", point.response}});
  }
  const Descriptors& descriptors = features.descriptors;
  const bool is_float = descriptors.kind == DescriptorKind::kFloat;
  const std::string data =
      is_float ? Base64(descriptors.floats.data(), descriptors.floats.size() * sizeof(float))
               : Base64(descriptors.bytes.data(), descriptors.bytes.size());
  return TaggedResponse({{"width", features.width},
                         {"height", features.height},
                         {"model_id", features.model_id},
                         {"keypoints", keypoints},
                         {"descriptors",
                          {{"type", is_float ? "float32" : "uint8"},
                           {"rows", descriptors.rows},
                           {"dim", descriptors.dim},
                           {"base64", data}}}});
}

Parameter Sha256Parameter() {
  return {"sha256",
          "of the image as its record has it: where it is still that, caches may keep the answer "
          "for good (Cache-Control: immutable)"};
}

Response Preview(Service& service, const Request& request, const Parameters& parameters) {
  const UploadedImage image = ImageOf(request, parameters, service.fetcher);
  Response response;
  service.pool.Run(WorkerPool::Lane::kSearch, [&](int) {
    response.body =
        MakeThumbnail(image.bytes, service.options.engine.extraction.decode, service.decode());
  });
  response.content_type = "image/jpeg";
  response.headers.emplace_back("Cache-Control", "no-store");
  response.headers.emplace_back("Content-Security-Policy", "default-src 'none'; sandbox");
  return response;
}

}  // namespace

void AddImageRoutes(Service& service, std::vector<Route>& routes) {
  AddUploadRoutes(service, routes);
  AddStoredImageRoutes(service, routes);
}

void AddImageDataRoutes(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "images.content",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images/{id}/content",
                    .summary = "The uploaded bytes",
                    .parameters = {Sha256Parameter()},
                    .answers = {{200, "the image, with ETag", "", "image/*"},
                                {206, "the part that Range names", "", "image/*"},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .codes = {"image_not_found", "content_not_kept"},
                    .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE/content")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Content(service, request, parameters);
                    }});
  routes.push_back({.name = "images.thumbnail",
                    .method = "GET",
                    .pattern = "/v1/collections/{c}/images/{id}/thumbnail",
                    .summary = "A JPEG preview, longer side 320 pixels",
                    .parameters = {Sha256Parameter()},
                    .answers = {{200, "the preview, with ETag", "", "image/jpeg"},
                                {304, "If-None-Match names its ETag", "", ""}},
                    .codes = {"image_not_found", "content_not_kept", "busy"},
                    .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE/thumbnail")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Thumbnail(service, request, parameters);
                    }});
  routes.push_back(
      {.name = "images.features",
       .method = "GET",
       .pattern = "/v1/collections/{c}/images/{id}/features",
       .summary = "Keypoints and descriptors: as JSON, these as base64 of "
                  "little-endian rows, or as NumPy's archive",
       .parameters =
           {Parameter("format", "npz: for numpy.load").Choice({"json", "npz"}).Default("json")},
       .answers = {{200, "the features", "Features"},
                   {200, "with format=npz", "", kNpzType},
                   {304, "If-None-Match names its ETag", "", ""}},
       .codes = {"image_not_found"},
       .example = R"(curl "$PLIANT/v1/collections/default/images/$IMAGE/features")",
       .handler = [&service](const Request& request, const Parameters& parameters) {
         return FeaturesOf(service, request, parameters);
       }});
}

void AddPreviewRoute(Service& service, std::vector<Route>& routes) {
  routes.push_back({.name = "preview",
                    .method = "POST",
                    .pattern = "/v1/preview",
                    .summary = "A JPEG preview of an image that is not stored, longer side 320 "
                               "pixels",
                    .body = BodyKind::kImageOrJson,
                    .answers = {{200, "the preview", "", "image/jpeg"}},
                    .example = R"(curl -F image=@mug.png -o small.jpg "$PLIANT/v1/preview")",
                    .handler = [&service](const Request& request, const Parameters& parameters) {
                      return Preview(service, request, parameters);
                    }});
}

}  // namespace pliant::server
