// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/common.h"

#include <algorithm>
#include <utility>

#include "index/text.h"
#include "server/http/router.h"
#include "server/problem.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMaxFilenameBytes = 255;

// The last part of what a client says its file is called, as far as it can be shown.
std::string BaseName(const std::string& filename) {
  const std::size_t slash = filename.find_last_of("/\\");
  std::string name = slash == std::string::npos ? filename : filename.substr(slash + 1);
  const bool control =
      std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < ' ' || c == 0x7f; });
  if (control || name.size() > kMaxFilenameBytes || !IsValidUtf8(name)) return {};
  return name;
}

Bytes AsBytes(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

Json TimeOrNull(std::int64_t unix_ms) {
  return unix_ms == 0 ? Json(nullptr) : Json(FormatTime(unix_ms));
}

}  // namespace

const std::string& CollectionOf(const Request& request) { return request.captures.at("c"); }

UploadedImage ImageOf(const Request& request) {
  if (!request.is_multipart()) {
    if (request.has_body && request.content_type != "application/json")
      return {AsBytes(request.body), {}};
    throw ProblemError("missing_parameter",
                       "A picture is required: as the body, or as the form field 'image'.")
        .Parameter("image");
  }
  const Part* image = nullptr;
  for (const Part& part : request.parts) {
    if (part.name != "image") continue;
    if (image != nullptr) {
      throw ProblemError("duplicate_parameter", "There is more than one form field 'image'.")
          .Parameter("image");
    }
    image = &part;
  }
  if (image == nullptr) {
    throw ProblemError("missing_parameter", "The form field 'image' is required.")
        .Parameter("image");
  }
  return {AsBytes(image->content), BaseName(image->filename)};
}

std::string MakeCursor(const std::string& list, const std::string& after) {
  return Base64UrlEncode(ToText(Json::array({list, after})));
}

std::string AfterFromCursor(const Parameters& parameters, const std::string& list) {
  const auto cursor = parameters.Text("cursor");
  if (!cursor || cursor->empty()) return {};
  std::string text;
  if (Base64UrlDecode(*cursor, &text)) {
    const Json json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
    if (json.is_array() && json.size() == 2 && json[0] == list && json[1].is_string()) {
      return json[1].get<std::string>();
    }
  }
  throw ProblemError("invalid_cursor",
                     "The cursor is none that this list gave. Ask again without one.")
      .Parameter("cursor");
}

Json MetadataJson(const std::string& metadata) {
  Json json = Json::parse(metadata, nullptr, /*allow_exceptions=*/false);
  return json.is_object() ? json : Json::object();
}

Json ImageJson(const ImageRecord& image) {
  return {{"id", image.id},
          {"collection", image.collection},
          {"object", image.object},
          {"metadata", MetadataJson(image.metadata)},
          {"source", image.source},
          {"sha256", image.sha256},
          {"media_type", image.media_type},
          {"bytes", image.bytes},
          {"width", image.width},
          {"height", image.height},
          {"keypoints", image.keypoints},
          {"added_at", FormatTime(image.added_ms)}};
}

Json VocabularyJson(const VocabularyRecord& vocabulary) {
  return {{"id", vocabulary.id},
          {"words", vocabulary.words},
          {"active", vocabulary.active},
          {"model_id", vocabulary.model_id},
          {"method", vocabulary.origin.method},
          {"seed", vocabulary.origin.seed},
          {"sampled", vocabulary.origin.sampled},
          {"available", vocabulary.origin.available},
          {"loss", vocabulary.origin.loss},
          {"created_at", FormatTime(vocabulary.created_ms)}};
}

Json JobJson(const JobStatus& job) {
  Json json = {{"id", job.id},
               {"kind", job.kind},
               {"collection", job.collection},
               {"state", JobStateName(job.state)},
               {"done", job.done},
               {"total", job.total},
               {"failed", job.failed},
               {"created_at", FormatTime(job.created_ms)},
               {"finished_at", TimeOrNull(job.finished_ms)}};
  if (!job.result.empty()) json["result"] = job.result;
  if (job.problem) {
    json["problem"] = {{"code", job.problem->code},
                       {"parameter", job.problem->parameter},
                       {"detail", job.problem->detail}};
  }
  return json;
}

std::string ImagePath(const ImageRecord& image) {
  return "/v1/collections/" + EncodeSegment(image.collection) + "/images/" +
         EncodeSegment(image.id);
}

Response JsonResponse(const Json& json, int status) {
  return JsonTextResponse(ToText(json), status);
}

Response JsonTextResponse(std::string json, int status) {
  Response response;
  response.status = status;
  response.content_type = "application/json";
  response.body = std::move(json);
  response.headers.emplace_back("Cache-Control", "no-store");
  return response;
}

bool IfNoneMatch(const Request& request, const std::string& etag) {
  const std::string wanted = request.header("If-None-Match");
  return wanted == "*" || wanted.find(etag) != std::string::npos;
}

}  // namespace pliant::server
