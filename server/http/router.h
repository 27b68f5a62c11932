// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The route table as data: method, path pattern, parameters, body and handler. Requests are checked
// against it, and the OpenAPI document is made from it, so the two cannot differ.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/http/message.h"

namespace pliant::server {

// One parameter. In the query and in forms it is text of this type, in a JSON body a value of the
// type that the OpenAPI document gives for it. Built like
//   Parameter("limit", "hits a page").Integer(1, 1000).Default("10")
struct Parameter {
  enum class Type {
    kText,
    kInteger,   // lowest..highest
    kNumber,    // lowest..highest
    kNumbers,   // exactly `count` of them, comma-separated
    kChoice,    // one of `choices`; a choice "x.KEY" is x. and any text
    kBoolean,   // "true" or "false"
    kJson,      // a JSON object
    kJsonList,  // a JSON array
    kImage,     // a JSON object: {"image": base64} or {"image_url": address}
  };

  Parameter(const char* parameter_name, const char* for_what)
      : name(parameter_name), meaning(for_what) {}

  Parameter Integer(std::int64_t from, std::int64_t to) && {
    return Is(Type::kInteger, static_cast<double>(from), static_cast<double>(to));
  }
  Parameter Number(double from, double to) && { return Is(Type::kNumber, from, to); }
  Parameter Numbers(std::size_t how_many) && {
    count = how_many;
    return Is(Type::kNumbers);
  }
  Parameter Choice(std::vector<std::string> names) && {
    choices = std::move(names);
    return Is(Type::kChoice);
  }
  Parameter Boolean() && { return Is(Type::kBoolean); }
  Parameter Json() && { return Is(Type::kJson); }
  Parameter JsonList() && { return Is(Type::kJsonList); }
  Parameter Image() && { return Is(Type::kImage); }
  // The value when it is not given, as text.
  Parameter Default(const char* value) && {
    default_value = value;
    return std::move(*this);
  }
  Parameter Required() && {
    required = true;
    return std::move(*this);
  }

  std::string name;
  std::string meaning;
  Type type = Type::kText;
  double lowest = 0;
  double highest = 0;
  std::size_t count = 0;
  std::vector<std::string> choices = {};
  std::string default_value = {};
  bool required = false;

 private:
  Parameter Is(Type which, double from = 0, double to = 0) {
    type = which;
    lowest = from;
    highest = to;
    return std::move(*this);
  }
};

// Whether the text is this choice of a parameter.
bool IsChoice(const std::string& choice, std::string_view text);

// One answer of a route that succeeds.
struct Answer {
  int status = 200;
  std::string meaning;
  std::string schema = {};  // name of a component; empty = no body, or no JSON
  std::string content_type = "application/json";  // when `schema` or a body; empty = no body
};

// The body that a route takes.
enum class BodyKind {
  kNone,  // a body is ignored
  kJson,  // or no body
  kImageOrJson,
  kPair,  // two images; parameters can be images
  kBulk,  // NDJSON or tar
  kFile,  // any bytes
  kMergePatch,
};

// Its media types; image/* are all images.
std::vector<std::string> TypesOf(BodyKind body);

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
  // In the query, as form fields, or as keys of a JSON body.
  std::vector<Parameter> parameters = {};
  std::vector<Answer> answers = {};
  // Problem codes beyond those that follow from the method, the scope, the body, the path and the
  // parameters (openapi/document.h).
  std::vector<std::string> codes = {};
  // A shell command that uses the route, or only what a plain request by curl lacks;
  // openapi/document.h explains its variables. A test runs it.
  std::string example = {};
  Handler handler;
  // Makes the sink for a body in chunks or beyond the server's limit, after the checks of the head
  // and its parameters; the handler finds the sink in Request::received. Throws to refuse the body,
  // also for its size (0: in chunks, not known yet).
  Receive receive = {};
  bool takes_if_match = false;  // the handler checks If-Match; without it only GET supports it
  bool needs_index = true;      // answered with "starting" while the index loads
};

// Whether the route supports Idempotency-Key: it changes something, by a method that is not safe to
// repeat. A route that answers with a secret does not: the server would have to store the secret.
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

  // The path's methods, as in Allow ("DELETE, GET, HEAD"). Throws ProblemError "route_not_found".
  std::string AllowedMethods(const std::vector<std::string>& segments) const;

 private:
  std::vector<Route> routes_;
  std::vector<std::vector<std::string>> patterns_;  // routes_[i].pattern, split at '/'
};

// Splits an absolute path at '/' and percent-decodes each segment. Throws ProblemError
// "bad_request" for a broken escape or a segment that is not UTF-8.
std::vector<std::string> SplitPath(std::string_view path);

// Inverse for one segment: everything but RFC 3986's unreserved characters becomes %XX.
std::string EncodeSegment(std::string_view text);

// Throws ProblemError "unsupported_content_type" for a body that the route does not take. curl and
// others send an image without a type or as that of a form: such a body is looked at later.
void CheckContentType(const Route& route, const Request& request);
// Gives such a body, which must be whole, the type of its bytes: JSON, or a file. Throws the same
// for other text.
void NameContentType(const Route& route, Request& request);

}  // namespace pliant::server
