// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One HTTP request and its answer, as the routes see them: no type of the HTTP library.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <strings.h>

namespace pliant::server {

class BodyFile;

// Scope of a caller; each includes those before it, except kPeer: it allows what other servers of
// the same database ask for, and nothing else.
enum class Scope { kPublic, kRead, kWrite, kAdmin, kPeer };

// "public", "read", "write", "admin", "peer"
inline const char* ScopeName(Scope scope) {
  constexpr const char* kNames[] = {"public", "read", "write", "admin", "peer"};
  return kNames[static_cast<int>(scope)];
}

// Who sent a request.
struct Caller {
  std::string key_id = {};  // of the API key; empty when none was needed
  std::string key_name = {};
  Scope scope = Scope::kPublic;
};

// Receives a long body of a request piece by piece, so that it is never completely in memory. Used
// by one thread at a time. A sink that is destroyed before the body was complete, because the
// client left or the body was refused, leaves nothing behind.
class BodySink {
 public:
  BodySink() = default;
  virtual ~BodySink() = default;
  BodySink(const BodySink&) = delete;
  BodySink& operator=(const BodySink&) = delete;

  // Called by the thread that polls all connections: must not take long. Its exception is the
  // request's answer, and the rest of the body is not read.
  virtual void Append(std::string_view bytes) = 0;
  // The complete body, if the sink can show it as a whole; valid as long as the sink.
  virtual std::string_view All() { return {}; }
};

// Orders header names without regard to case (RFC 9110, section 5.1).
struct HeaderNameLess {
  bool operator()(const std::string& a, const std::string& b) const {
    return ::strcasecmp(a.c_str(), b.c_str()) < 0;
  }
};
using HeaderFields = std::multimap<std::string, std::string, HeaderNameLess>;

inline constexpr const char* kNdjsonType = "application/x-ndjson";
inline constexpr const char* kNpzType = "application/vnd.numpy.npz";
inline constexpr const char* kTarType = "application/x-tar";
inline constexpr const char* kFileType = "application/octet-stream";

// By any of its names: NDJSON, JSON lines.
inline bool IsNdjsonType(const std::string& type) {
  return type == kNdjsonType || type == "application/ndjson" || type == "application/jsonl" ||
         type == "application/x-jsonlines";
}

// One part of a multipart/form-data body.
struct Part {
  std::string name;
  std::string filename;      // empty for a text field
  std::string content_type;  // as sent; may be empty
  std::string_view content;  // inside Request::body
};

enum class BodyFraming { kNone, kLength, kChunked };

struct Request {
  std::string method;  // routes see GET for HEAD
  std::string target;  // path and query as sent
  bool is_http_1_0 = false;
  HeaderFields headers;  // without the spaces around their values
  BodyFraming framing = BodyFraming::kNone;
  std::uint64_t length = 0;  // of the body, for kLength; saturated

  // The session sets these from the above.
  std::string id;                     // the client's X-Request-Id where acceptable, else made here
  std::string path;                   // as sent, without the query
  std::vector<std::string> segments;  // of the path, percent-decoded
  std::map<std::string, std::string> captures;  // {name} of the route's pattern
  std::multimap<std::string, std::string> query;
  std::string remote_address;  // of the client, also behind a trusted proxy
  std::string base_path;  // before the paths of the routes, for the client: "/pliant"; "" = none
  bool is_https = false;  // between the client and the first server
  Caller caller;          // empty for a public route
  std::vector<std::pair<std::string, std::string>> answer_headers;  // of any answer to it

  std::string content_type;  // media type of the body in lower case, without parameters
  std::string body;
  std::vector<Part> parts;
  std::shared_ptr<BodySink> received = {};  // has the body, where the route receives it by itself
  bool has_body = false;
  bool waited = false;  // the handler's Wait is over: now it must answer

  // The first header of that name; empty when there is none.
  std::string header(const std::string& name) const {
    const auto it = headers.find(name);
    return it == headers.end() ? std::string() : it->second;
  }
  bool is_multipart() const { return content_type == "multipart/form-data"; }
};

// A handler can return this instead of an answer. The server calls it again, with Request::waited,
// when the event happens, the time is up, the client leaves, or the server stops. Meanwhile the
// request holds no thread.
struct Wait {
  std::chrono::steady_clock::time_point until;
  // Called once. Calls `wake` at most once, from any thread, when it has happened; at once if it
  // already has. Not after the returned object is gone. Must not wait.
  std::function<std::shared_ptr<void>(std::function<void()> wake)> subscribe;
};

struct Response {
  int status = 200;
  std::string content_type = {};
  std::string body = {};
  std::vector<std::pair<std::string, std::string>> headers = {};
  std::shared_ptr<const BodyFile> file = {};  // the body instead of `body`
  std::optional<Wait> wait = {};  // only of routes that take no body; then the rest means nothing

  // The first header of that name, as written; empty when there is none.
  std::string header(const std::string& name) const {
    for (const auto& [one, value] : headers) {
      if (one == name) return value;
    }
    return {};
  }
};

}  // namespace pliant::server
