// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/common.h"

#include <algorithm>
#include <utility>

#include "descriptor/base/base64.h"
#include "index/files/text.h"
#include "server/http/conditions.h"
#include "server/http/problem.h"
#include "server/http/router.h"

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
  return unix_ms == 0 ? Json(nullptr) : Json(IsoTime(unix_ms));
}

}  // namespace

Parameter CursorParameter() {
  return {"cursor", "`next` of the page before, for the one after it"};
}

Parameter LimitParameter() {
  return Parameter("limit", "entries a page").Integer(1, kLargestPage).Default("50");
}

int PageLimit(const Parameters& parameters) {
  return static_cast<int>(parameters.Integer("limit").value_or(kDefaultPage));
}

std::string CollectionOf(Service& service, const Request& request) {
  return service.engine().CollectionName(request.captures.at("c"));
}

UploadedImage ImageOfBase64(const std::string& text, const std::string& name) {
  auto decoded = std::make_shared<std::vector<std::uint8_t>>();
  if (!Base64Decode(text, decoded.get())) ThrowInvalid(name, name + " is no base64.");
  const Bytes bytes(*decoded);
  return {bytes, {}, std::move(decoded)};
}

UploadedImage ImageOf(const Request& request, const Parameters& parameters, Fetcher& fetcher,
                      Fetcher::For whom) {
  if (const std::string* base64 = parameters.image_base64()) {
    return ImageOfBase64(*base64, "image");
  }
  if (const std::string* url = parameters.image_url()) {
    FetchedPicture fetched = fetcher.Fetch(*url, whom);
    const Bytes bytes(*fetched.bytes);
    return {bytes, std::move(fetched.source), std::move(fetched.bytes)};
  }
  if (!request.is_multipart()) {
    if (request.has_body && request.content_type != "application/json")
      return {AsBytes(request.body), {}, {}};
    throw ProblemError("missing_parameter",
                       "A picture is required: as the body, as the form field 'image', or in a "
                       "JSON body as base64 in 'image' or by its address in 'image_url'.")
        .Parameter("image");
  }
  const std::vector<UploadedImage> images = ImagesOf(request);
  if (images.size() > 1) {
    throw ProblemError("duplicate_parameter", "There is more than one form field 'image'.")
        .Parameter("image");
  }
  return images.front();
}

std::vector<UploadedImage> ImagesOf(const Request& request) {
  std::vector<UploadedImage> images;
  for (const Part& part : request.parts) {
    if (part.name == "image")
      images.push_back({AsBytes(part.content), BaseName(part.filename), {}});
  }
  if (images.empty()) {
    throw ProblemError("missing_parameter", "The form field 'image' is required.")
        .Parameter("image");
  }
  return images;
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
  ThrowInvalidCursor();
}

void ThrowInvalidCursor() {
  throw ProblemError("invalid_cursor",
                     "The cursor is none that this list gave. Ask again without one.")
      .Parameter("cursor");
}

bool MaySee(const Caller& caller, const JobStatus& job) {
  return caller.scope >= Scope::kAdmin || (job.kind != "backup" && job.kind != "import");
}

JobStatus JobOf(const JobQueue& jobs, const Request& request) {
  JobStatus job = jobs.Get(request.captures.at("id"));
  if (!MaySee(request.caller, job)) ThrowJobNotFound();
  return job;
}

Json JobJson(const JobStatus& job) {
  Json json = {{"id", job.id},
               {"kind", job.kind},
               {"collection", job.collection},
               {"parameters", job.parameters},
               {"state", JobStateName(job.state)},
               {"done", job.done},
               {"total", job.total},
               {"failed", job.failed},
               {"attempts", job.attempts},
               {"created_at", IsoTime(job.created_ms)},
               {"finished_at", TimeOrNull(job.finished_ms)}};
  if (!job.result.empty()) json["result"] = job.result;
  for (const SkippedItem& item : job.skipped) {
    json["skipped"].push_back({{"item", item.item}, {"code", item.code}, {"reason", item.reason}});
  }
  if (job.problem) json["problem"] = ProblemSummary(*job.problem);
  return json;
}

Json ProblemSummary(const Problem& problem) {
  Json json = {{"code", problem.code}, {"detail", problem.detail}};
  if (!problem.parameter.empty()) json["parameter"] = problem.parameter;
  return json;
}

Response JobResponse(const JobStatus& job) {
  Response response = JsonResponse(JobJson(job), 202);
  response.headers.emplace_back("Location", "/v1/jobs/" + job.id);
  return response;
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
  return !NamedByIfNoneMatch(request, etag).empty();
}

}  // namespace pliant::server
