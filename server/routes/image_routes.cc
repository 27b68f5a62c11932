// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Images: add, replace, list, show, change, delete.
#include <utility>

#include "descriptor/base/base64.h"
#include "descriptor/base/sha256.h"
#include "index/files/features_npz.h"
#include "index/json/record_json.h"
#include "server/http/conditions.h"
#include "server/http/json.h"
#include "server/http/problem.h"
#include "server/routes/answers.h"
#include "server/routes/lists.h"
#include "server/routes/request_body.h"
#include "server/routes/routes.h"

namespace pliant::server {
namespace {

constexpr int kThumbnailSidePx = 320;

ImageCheck CheckOf(const Request& request) {
  return [&request](const ImageRecord* now) {
    CheckConditionsOf(request, now == nullptr ? Json(nullptr) : ImageJson(*now));
  };
}

// Describes the image on the pool, updates the metrics, and notifies the automatic training. The
// problem "same_bytes" names the image with these bytes, so that a client can change that one.
AddResult AddOnPool(Service& service, AddRequest request, const ImageCheck& check) {
  try {
    // Waiting for a slow store must not hold cores that searches need.
    std::function<AddResult()> write;
    service.pool.Run(WorkerPool::Lane::kUpload, [&](int cores) {
      request.threads = cores;
      write = service.engine().BeginAdd(request, check);
    });
    AddResult result = write();
    if (result.outcome != AddOutcome::kUnchanged) {
      service.metrics.OnAdd(result.timings, result.image.collection);
      service.OnAdded(result.image.collection);
    }
    return result;
  } catch (const Error& error) {
    if (error.reason() != "same_bytes") throw;
    Problem problem = CurrentProblem();
    if (auto stored = service.engine().FindBySha256(request.collection, Sha256Hex(request.bytes))) {
      problem.stored = {.image_id = stored->id, .object = stored->object};
    }
    throw ProblemError(std::move(problem));
  }
}

Response Add(Service& service, const Request& request, const Parameters& parameters,
             std::optional<std::string> id, const ImageCheck& check = {}) {
  const UploadedImage image = ImageOf(request, parameters, service.fetcher);
  AddRequest add;
  add.collection = CollectionOf(service, request);
  add.id = std::move(id);
  add.object = parameters.Text("object").value_or("");
  add.metadata = parameters.Text("metadata").value_or("{}");
  add.source = image.filename;
  add.bytes = image.bytes;
  const AddResult result = AddOnPool(service, add, check);
  const bool created = result.outcome == AddOutcome::kCreated;
  const Json record = ImageJson(result.image);
  const int status = created ? 201 : 200;
  Response response = check ? RecordResponse(record, status) : JsonResponse(record, status);
  response.headers.emplace_back(created ? "Location" : "Content-Location",
                                "/v1/collections/" + EncodeSegment(result.image.collection) +
                                    "/images/" + EncodeSegment(result.image.id));
  return response;
}

Response Create(Service& service, const Request& request, const Parameters& parameters) {
  std::optional<std::string> id = parameters.Text("id");
  if (id && id->empty()) id.reset();  // an empty form field
  return Add(service, request, parameters, std::move(id));
}

Response Put(Service& service, const Request& request, const Parameters& parameters) {
  return Add(service, request, parameters, request.captures.at("id"), CheckOf(request));
}

const Choices<ImageOrder> kImageOrders = {
    {"id", ImageOrder::kId},           {"created", ImageOrder::kCreated},
    {"updated", ImageOrder::kUpdated}, {"object", ImageOrder::kObject},
    {"source", ImageOrder::kSource},   {"metadata.KEY", ImageOrder::kMetadata}};

Response List(Service& service, const Request& request, const Parameters& parameters) {
  return ListAnswer<ImageListing>(service, request, parameters, "images", kImageOrders, ImageJson);
}

Response DeleteWhere(Service& service, const Request& request, const Parameters& parameters) {
  const Selection which = SelectionOf(parameters, request.captures.at("c"));
  if (which.filter.empty()) {
    ThrowInvalid("filter",
                 "filter needs a condition. To delete all images, delete their objects or the "
                 "collection.");
  }
  return JsonResponse({{"deleted", service.engine().RemoveWhere(which)}});
}

Response Get(Service& service, const Request& request, const Parameters&) {
  return RecordResponse(
      ImageJson(service.engine().Get(request.captures.at("c"), request.captures.at("id"))));
}

Response Patch(Service& service, const Request& request, const Parameters&) {
  const Json patch = MergePatchOf(request, {"object", "metadata", "source", "collection"});
  ImageChange change;
  change.object = TextIn(patch, "object");
  change.collection = TextIn(patch, "collection");
  change.source = TextIn(patch, "source");
  if (const auto it = patch.find("metadata"); it != patch.end()) {
    if (!it->is_object() && !it->is_null()) {
      ThrowInvalid("metadata", "metadata must be an object of keys to set, or null.");
    }
    change.metadata = ToText(*it);
  }
  change.check = [&](const ImageRecord& now) { CheckIfMatch(request, ImageJson(now)); };
  const ImageRecord changed =
      service.engine().Change(request.captures.at("c"), request.captures.at("id"), change);
  if (change.collection) service.OnAdded(changed.collection);
  return RecordResponse(ImageJson(changed));
}

Response Delete(Service& service, const Request& request, const Parameters&) {
  const std::string& id = request.captures.at("id");
  if (!service.engine().Remove(request.captures.at("c"), id, CheckOf(request))) {
    throw ProblemError("image_not_found", "No image has the id '" + id + "'.");
  }
  return {.status = 204};
}

// An answer with bytes of an image, which `read` adds unless the client has them. A browser must
// not run the bytes that a stranger uploaded. Anyone who names the bytes can cache them: they never
// change at that address. Another key may not see them.
Response ImageBytes(Service& service, const Request& request, const Parameters& parameters,
                    const std::string& etag_suffix,
                    const std::function<void(const ImageRecord&, Response&)>& read) {
  const ImageRecord image =
      service.engine().Get(request.captures.at("c"), request.captures.at("id"));
  const bool named = parameters.Text("sha256") == image.sha256;
  const std::string etag = '"' + image.sha256 + etag_suffix + '"';
  Response response{.headers = {{"ETag", etag},
                                {"Cache-Control", named ? "private, max-age=31536000, immutable"
                                                        : "private, no-cache"},
                                {"Vary", "Authorization, X-API-Key"},
                                {"Content-Security-Policy", "default-src 'none'; sandbox"}}};
  if (NamedByIfNoneMatch(request, etag).empty()) {
    read(image, response);
  } else {
    response.status = 304;
  }
  return response;
}

Response Content(Service& service, const Request& request, const Parameters& parameters) {
  const auto read = [&](const ImageRecord& image, Response& response) {
    const auto bytes = service.engine().GetContent(image.collection, image.id);
    response.body.assign(bytes.begin(), bytes.end());
    response.content_type = image.media_type.starts_with("image/") ? image.media_type : kFileType;
  };
  Response response = ImageBytes(service, request, parameters, "", read);
  response.headers.emplace_back("Accept-Ranges", "bytes");
  return response;
}

Response Thumbnail(Service& service, const Request& request, const Parameters& parameters) {
  const auto read = [&](const ImageRecord& image, Response& response) {
    std::shared_ptr<const std::string> jpeg = service.thumbnails.Find(image.sha256);
    if (!jpeg) {
      jpeg = std::make_shared<const std::string>(service.Shrink(
          service.engine().GetContent(image.collection, image.id), kThumbnailSidePx));
      service.thumbnails.Add(image.sha256, jpeg);
    }
    response.content_type = "image/jpeg";
    response.body = *jpeg;
  };
  return ImageBytes(service, request, parameters, "-" + std::to_string(kThumbnailSidePx), read);
}

Response Preview(Service& service, const Request& request, const Parameters& parameters) {
  const UploadedImage image = ImageOf(request, parameters, service.fetcher);
  return {.content_type = "image/jpeg",
          .body = service.Shrink(image.bytes, kThumbnailSidePx),
          .headers = {{"Cache-Control", "no-store"},
                      {"Content-Security-Policy", "default-src 'none'; sandbox"}}};
}

// Descriptors row by row, little-endian. Base64 keeps them exact, at a third of the size of decimal
// numbers.
Response FeaturesOf(Service& service, const Request& request, const Parameters& parameters) {
  const std::string& id = request.captures.at("id");
  const Features features = service.engine().GetFeatures(request.captures.at("c"), id);
  if (parameters.Text("format") == "npz") {
    return {.content_type = kNpzType,
            .body = FeaturesNpz(features),
            .headers = {{"Cache-Control", "no-store"},
                        {"Content-Disposition", "attachment; filename=\"" + id + ".npz\""}}};
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

Parameter ObjectParameter() { return {"object", "the object that the image shows"}; }
Parameter MetadataParameter() {
  return Parameter("metadata", "a JSON object to store with the image").Json();
}
Parameter Sha256Parameter() {
  return {"sha256",
          "the SHA-256 of the image's record; if it is current, caches can keep the answer "
          "permanently (Cache-Control: immutable)"};
}

void AddUploadRoutes(RouteTable& table) {
  table.Add("POST /v1/collections/{c}/images", "images.create", Create)
      .Summary("Add an image. Sending the same bytes again changes nothing")
      .Body(BodyKind::kImageOrJson)
      .Takes({{"id", "id of the image; by default made from its bytes"},
              ObjectParameter(),
              MetadataParameter()})
      .Answers(201, "added", "Image")
      .Answers(200, "unchanged: the collection already has the same bytes", "Image")
      .Example(R"(-F image=@mug.png -F object=mug)");
  table.Add("PUT /v1/collections/{c}/images/{id}", "images.put", Put)
      .Summary("Add or replace the image with this id")
      .Body(BodyKind::kImageOrJson)
      .Takes({ObjectParameter(), MetadataParameter()})
      .TakesIfMatch()
      .Answers(201, "added", "Image")
      .Answers(200, "replaced, or unchanged if everything is the same", "Image")
      .Example(R"(curl -X PUT -H "Content-Type: image/png" --data-binary @cup.png )"
               R"("$PLIANT/v1/collections/default/images/cup-1?object=cup")");
  table.Add("POST /v1/preview", "preview", Preview)
      .Summary("Get a JPEG of an image that the server does not store, longer side 320 pixels")
      .Needs(Scope::kRead)
      .Body(BodyKind::kImageOrJson)
      .Sends("image/jpeg", "the preview")
      .Example(R"(-F image=@mug.png -o small.jpg)");
}

void AddRecordRoutes(RouteTable& table) {
  table.Add("GET /v1/collections/{c}/images/{id}", "images.get", Get)
      .Summary("Get the record of one image")
      .Answers(200, "the record, with ETag", "Image")
      .AnswersNotModified();
  table.Add("PATCH /v1/collections/{c}/images/{id}", "images.patch", Patch)
      .Summary(
          "Change the object, metadata or source of an image, or move it to another collection")
      .Patches("ImagePatch")
      .TakesIfMatch()
      .Answers(200, "the record after the change", "Image")
      .Codes({"image_exists"})
      .ExampleBody(R"({"metadata": {"shelf": 5}})");
  table.Add("DELETE /v1/collections/{c}/images/{id}", "images.delete", Delete)
      .Summary("Delete an image; later answers do not contain it")
      .TakesIfMatch()
      .Answers(204, "deleted");
}

void AddDataRoutes(RouteTable& table) {
  table.Add("GET /v1/collections/{c}/images/{id}/content", "images.content", Content)
      .Summary("Get the uploaded bytes")
      .Takes({Sha256Parameter()})
      .Sends("image/*", "the image, with ETag")
      .Sends("image/*", "the bytes that Range asks for", 206)
      .AnswersNotModified()
      .Codes({"content_not_kept"});
  table.Add("GET /v1/collections/{c}/images/{id}/thumbnail", "images.thumbnail", Thumbnail)
      .Summary("Get a JPEG preview, longer side 320 pixels")
      .Takes({Sha256Parameter()})
      .Sends("image/jpeg", "the preview, with ETag")
      .AnswersNotModified()
      .Codes({"content_not_kept"});
  table.Add("GET /v1/collections/{c}/images/{id}/features", "images.features", FeaturesOf)
      .Summary("Get the keypoints and descriptors of one image")
      .Takes({Parameter("format",
                        "json: descriptors are base64 of little-endian rows; npz: for numpy.load")
                  .Choice({"json", "npz"})
                  .Default("json")})
      .Answers(200, "the features", "Features")
      .Sends(kNpzType, "with format=npz")
      .AnswersNotModified();
}

}  // namespace

void AddImageRoutes(RouteTable& table) {
  AddUploadRoutes(table);
  std::vector<Parameter> listing = ListParameters(NamesOf(kImageOrders));
  listing.insert(listing.begin(), OfObjectParameter());
  table.Add("GET /v1/collections/{c}/images", "images.list", List)
      .Summary("List images page by page")
      .Takes(std::move(listing))
      .Answers(200, "a page", "ImageList")
      .Example(R"(curl "$PLIANT/v1/collections/default/images?limit=10&sort=-created")");
  table.Add("DELETE /v1/collections/{c}/images", "images.delete_where", DeleteWhere)
      .Summary("Delete all images whose metadata match a filter, in one transaction")
      .Takes({FilterParameter().Required(), OfObjectParameter(), TextParameter()})
      .Answers(200, "the number of deleted images", "ImagesDeleted")
      .Example(R"(-G --data-urlencode 'filter={"batch": 7}')");
  AddRecordRoutes(table);
  AddDataRoutes(table);
}

}  // namespace pliant::server
