// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The route table as data: method, path pattern, what it takes, and the handler.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/message.h"
#include "server/http/route_spec.h"

namespace pliant::server {

// What a route takes as its body.
enum class BodyKind {
  kNone,
  kJson,         // application/json, or no body
  kImageOrJson,  // image/*, application/octet-stream, multipart/form-data or application/json
  kPair,         // a form of two images, or application/json; parameters may be images
  kBulk,         // application/x-ndjson or application/x-tar
  kMergePatch,   // a JSON merge patch: application/merge-patch+json or application/json
};

class Parameters;
using Handler = std::function<Response(const Request&, const Parameters&)>;
using Receive = std::function<std::shared_ptr<BodySink>(const Request&, std::uint64_t body_bytes)>;

struct Route {
  std::string name;          // "images.create"; stable, used in logs and metrics
  std::string method;        // "GET" (answers HEAD too), "POST", "PUT", "PATCH", "DELETE"
  std::string pattern;       // "/v1/collections/{c}/images"; {x} captures one segment
  std::string summary = {};  // for the OpenAPI document
  Scope scope = Scope::kRead;
  BodyKind body = BodyKind::kNone;
  std::string body_schema = {};  // of a merge patch: name of a component
  // What it understands in the query, as form fields, or as keys of a JSON body.
  std::vector<Parameter> parameters = {};
  std::vector<Answer> answers = {};
  // Problem codes beyond those that follow from the method, the scope, the body, the path and the
  // parameters (openapi/document.h).
  std::vector<std::string> codes = {};
  // A shell command that shows the route at work, with the variables that openapi/document.h
  // explains. Run by a test.
  std::string example = {};
  Handler handler;
  // For bodies beyond the server's limit, or in chunks: called when the head is there and its
  // parameters are right, for what takes the body, which the handler finds in Request::received.
  // Throws what refuses it, also for its size (0: in chunks, not known yet): the limit does not
  // hold for it.
  Receive receive = {};
  bool takes_if_match = false;  // the handler looks at If-Match; others than GET refuse it
  bool needs_index = true;      // answered with "starting" while the index loads
};

// Whether the route heeds Idempotency-Key: it changes something, and not by a method that may be
// repeated as it is. One that tells a secret does not: the secret would have to be remembered.
bool HeedsIdempotencyKey(const Route& route);

// Immutable and thread-safe.
class Router {
 public:
  // Throws std::logic_error for two routes of the same method and pattern.
  explicit Router(std::vector<Route> routes);

  const std::vector<Route>& routes() const { return routes_; }

  // Finds the route for request.method and request.segments and fills request.captures. Throws
  // ProblemError "route_not_found", or "method_not_allowed" with Allow.
  const Route& Resolve(Request& request) const;

  // Methods that the path has, as for Allow ("DELETE, GET, HEAD"); empty = no such path.
  std::string AllowedMethods(const std::vector<std::string>& segments) const;

 private:
  std::vector<Route> routes_;
  std::vector<std::vector<std::string>> patterns_;  // routes_[i].pattern, split at '/'
};

// Splits an absolute path at '/' and percent-decodes each segment. Throws ProblemError
// "bad_request" for a broken escape or a segment that is not UTF-8.
std::vector<std::string> SplitPath(std::string_view path);

// The same for a route's pattern, which has no escapes.
std::vector<std::string> SplitPattern(const std::string& pattern);

// Inverse for one segment: everything but RFC 3986's unreserved characters becomes %XX.
std::string EncodeSegment(std::string_view text);

// Throws ProblemError "unsupported_content_type" when the request's body is none that the route
// takes.
void CheckContentType(const Route& route, const Request& request);
// Throws "precondition_failed" where If-Match would be ignored: the request must not be performed
// as if it held (RFC 9110, section 13.1.1).
void CheckConditions(const Route& route, const Request& request);

}  // namespace pliant::server
