// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What several routes share: uploads, cursors, answers.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "index/json/record_json.h"
#include "server/fetch/fetcher.h"
#include "server/http/json.h"
#include "server/http/message.h"
#include "server/http/parameters.h"
#include "server/jobs/jobs.h"
#include "server/routes/service.h"

namespace pliant::server {

inline constexpr int kDefaultPage = 50;
inline constexpr int kLargestPage = 500;

// Parameters that several routes take.
Parameter CursorParameter();
Parameter LimitParameter();
int PageLimit(const Parameters& parameters);

// The collection that the {c} of the path names, by its name or by an alias: its name. Ask once a
// request, since aliases can be moved meanwhile. kNotFound "collection_not_found".
std::string CollectionOf(Service& service, const Request& request);

struct UploadedImage {
  Bytes bytes;           // inside the request, or `decoded`
  std::string filename;  // base name, or the address it was fetched from; for people; may be empty
  std::shared_ptr<const std::vector<std::uint8_t>> decoded = {};  // of base64, or fetched
};

// The picture of the request: a raw body, the multipart part "image", or in a JSON body the key
// "image", as base64, or "image_url", which is fetched. Throws ProblemError "missing_parameter",
// "duplicate_parameter", "invalid_parameter" for what is no base64, and what Fetcher::Fetch throws.
UploadedImage ImageOf(const Request& request, const Parameters& parameters, Fetcher& fetcher,
                      Fetcher::For whom = Fetcher::For::kRequest);
// What is no base64 is ProblemError "invalid_parameter" for `name`.
UploadedImage ImageOfBase64(const std::string& text, const std::string& name);

// All parts "image". Throws ProblemError "missing_parameter" when there is none.
std::vector<UploadedImage> ImagesOf(const Request& request);

// The position in a list. A cursor contains the parameters of its list, so it cannot be used with
// another list.
std::string MakeCursor(const std::string& list, const std::string& after);
// Empty when there is no cursor, or an empty one. Throws ProblemError "invalid_cursor".
std::string AfterFromCursor(const Parameters& parameters, const std::string& list);
[[noreturn]] void ThrowInvalidCursor();

// Whether the caller may know of it. Backups and imports of folders are begun by admins, and their
// records name files of the server: to others they are not there.
bool MaySee(const Caller& caller, const JobStatus& job);
// The job that the {id} of the path names. Throws ProblemError "job_not_found".
JobStatus JobOf(const JobQueue& jobs, const Request& request);

Json JobJson(const JobStatus& job);
Json ProblemSummary(const Problem& problem);  // code, detail, parameter

// 202 with the job and its address.
Response JobResponse(const JobStatus& job);

std::string ImagePath(const ImageRecord& image);

Response JsonResponse(const Json& json, int status = 200);
Response JsonTextResponse(std::string json, int status = 200);

// Whether the client has it already (RFC 9110, section 13.1.2). `etag` with its quotes. Only for
// handlers that save work by not making the answer: all answers with an ETag are looked at later
// (http/conditions.h).
bool IfNoneMatch(const Request& request, const std::string& etag);

}  // namespace pliant::server
