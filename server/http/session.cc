// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/session.h"

#include <stdexcept>

#include <fmt/format.h>

#include "descriptor/base/hex.h"
#include "descriptor/base/strings.h"
#include "index/files/text.h"
#include "server/http/body_file.h"
#include "server/http/conditions.h"
#include "server/http/form.h"
#include "server/http/parameters.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMostPathBytes = 2048;
constexpr std::size_t kMostTargetBytes = 8192;
constexpr std::size_t kLoggedPathBytes = 256;
constexpr std::size_t kMostParts = 64;
// One connection in kWaitingShare can wait for an event; the others are for immediate answers.
constexpr int kWaitingShare = 2;

bool IsRequestId(const std::string& id) {
  return !id.empty() && id.size() <= 64 && IsNameOf(id, "-_.");
}

// A client of a proxy sends the whole address, whose host counts (RFC 9112, section 3.2.2).
void TakeAbsoluteForm(Request& request) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (!EqualsIgnoringCase(std::string_view(request.target).substr(0, scheme.size()), scheme)) {
      continue;
    }
    const std::size_t end =
        std::min(request.target.find_first_of("/?", scheme.size()), request.target.size());
    if (request.headers.count("Host") == 1) {
      request.headers.find("Host")->second =
          request.target.substr(scheme.size(), end - scheme.size());
    }
    request.target.erase(0, end);
    if (!request.target.starts_with('/')) request.target.insert(0, "/");
    return;
  }
}

// Of a path below the base; others stay, because a proxy can have taken the base off.
std::string WithoutBase(std::string path, const std::string& base) {
  const bool is_below =
      path.starts_with(base) && (path.size() == base.size() || path[base.size()] == '/');
  return is_below ? path.substr(base.size()) : path;
}

std::string Printable(std::string_view text) {
  std::string printable(text.substr(0, kLoggedPathBytes));
  for (char& c : printable) {
    if (c <= ' ' || c > '~') c = '?';
  }
  return printable;
}

}  // namespace

Session::Session(SessionContext& context, Request head, const std::string& remote_address,
                 std::chrono::steady_clock::time_point begun, bool is_last)
    : context_(context), begun_(begun), request_(std::move(head)) {
  if (!request_.method.empty()) record_.method = request_.method;
  if (request_.method == "HEAD") {
    request_.method = "GET";
    request_.headers.erase("Range");  // RFC 9110, section 14.2
  }
  request_.remote_address = remote_address;
  request_.is_https = !context.options.tls_certificate.empty();
  request_.base_path = context.options.base_path;
  context.proxies.Apply(request_);
  record_.remote_address = request_.remote_address;
  TakeAbsoluteForm(request_);
  const std::size_t mark = std::min(request_.target.find('?'), request_.target.size());
  request_.path = WithoutBase(request_.target.substr(0, mark), request_.base_path);
  request_.query = ParseQuery(request_.target.substr(std::min(mark + 1, request_.target.size())));
  request_.has_body = request_.framing != BodyFraming::kNone;
  const std::string type = request_.header("Content-Type");
  request_.content_type = Lower(Trimmed(type.substr(0, type.find(';'))));
  const std::string id = request_.header("X-Request-Id");
  request_.id = record_.id = IsRequestId(id) ? id : RandomHex(16);
  if (!request_.path.empty()) record_.path = Printable(request_.path);
  const std::string connection = Lower(request_.header("Connection"));
  const bool closes = connection.find("close") != std::string::npos;
  const bool keeps = connection.find("keep-alive") != std::string::npos;
  keeps_open_ = !is_last && !closes && (keeps || !request_.is_http_1_0);
}

bool Session::asks_for_health() const {
  const std::string& path = request_.path;
  return request_.framing == BodyFraming::kNone &&
         (path == "/livez" || path == "/readyz" || path == "/metrics");
}

bool Session::comes_from_peer() const { return request_.path.starts_with("/v1/peer"); }

bool Session::expects_continue() const {
  return !request_.is_http_1_0 && Lower(request_.header("Expect")) == "100-continue";
}

void Session::TakeBody(std::string body, std::uint64_t bytes) {
  request_.body = std::move(body);
  record_.bytes_in = bytes;
  has_whole_body_ = true;
}

Session::Next Session::Serve() {
  try {
    request_.waited = std::exchange(wait_, nullptr) != nullptr;
    if (auto answer = route_ == nullptr ? Check() : std::nullopt) {
      MakeAnswer(std::move(*answer));
      return Next::kAnswer;
    }
    if (request_.has_body && !has_whole_body_) return Next::kBody;
    if (RunHandler() == Next::kEvent) return Next::kEvent;
  } catch (...) {
    const Problem problem = CurrentProblem();
    keeps_open_ = keeps_open_ && (route_ != nullptr || problem.code != "bad_request");
    AnswerProblem(problem);
  }
  request_.received.reset();  // on this thread: a sink can have files to remove
  request_.parts.clear();
  request_.body = {};
  return Next::kAnswer;
}

// Checks the whole head before a long body is sent for nothing. Returns the answer to a browser's
// preflight.
std::optional<Response> Session::Check() {
  // HTTP/1.0, which no browser speaks, does without the header.
  if (!request_.is_http_1_0 && request_.headers.count("Host") != 1) {
    throw ProblemError("bad_request", "A request needs exactly one Host header.");
  }
  const std::string coding = Lower(request_.header("Content-Encoding"));
  if (request_.has_body && !coding.empty() && coding != "identity") {
    throw ProblemError("unsupported_content_encoding",
                       "The server does not accept compressed bodies. Send the body uncompressed.");
  }
  const auto host = request_.headers.find("Host");
  if (host != request_.headers.end() && !context_.allowed_hosts.Allows(host->second)) {
    throw ProblemError("host_not_allowed",
                       fmt::format("Unknown host name in the Host header: {}. The operator can "
                                   "allow it with --allowed-hosts.",
                                   Shown(host->second)));
  }
  if (request_.path.size() > kMostPathBytes || request_.target.size() > kMostTargetBytes) {
    throw ProblemError("uri_too_long", "The address is too long.");
  }
  if (request_.path.empty() && !request_.base_path.empty()) {  // the page is in a folder
    return Response{.status = 308, .headers = {{"Location", "/"}}};
  }
  request_.segments = SplitPath(request_.path);
  if (context_.origins.IsPreflight(request_)) {
    return OriginPolicy::PreflightAnswer(context_.router.AllowedMethods(request_.segments));
  }
  context_.origins.CheckSameSite(request_);
  route_ = &context_.router.Resolve(request_);
  record_.route = route_->name;
  // The request must not be performed as if the condition held (RFC 9110, section 13.1.1).
  if (request_.method != "GET" && !route_->takes_if_match &&
      request_.headers.contains("If-Match")) {
    throw ProblemError("precondition_failed",
                       "This route does not support If-Match. Nothing was changed.");
  }
  context_.options.admit(*route_, request_);
  record_.key_id = request_.caller.key_id;
  if (route_->needs_index && context_.stopping) {
    throw ProblemError("stopping", "The server is stopping.");
  }
  CheckContentType(*route_, request_);
  if (route_->body == BodyKind::kNone) {  // a body means nothing
    request_.has_body = false;
    request_.body = {};
  }
  // Chunks can have any number of bytes in total.
  const bool is_long = request_.framing == BodyFraming::kChunked ||
                       request_.length > context_.options.max_body_bytes;
  if (request_.has_body && route_->receive && is_long) {
    const Parameters checked(*route_, request_);
    request_.received = route_->receive(request_, request_.length);
  }
  return std::nullopt;
}

Session::Next Session::RunHandler() {
  if (request_.has_body && !request_.received) NameContentType(*route_, request_);
  if (!request_.received && request_.has_body && request_.is_multipart()) {
    request_.parts = ParseForm(request_.header("Content-Type"), request_.body, kMostParts);
  }
  const Parameters parameters(*route_, request_);
  Response response = route_->handler(request_, parameters);
  if (response.wait) return BeginWait(std::move(*response.wait));
  MakeAnswer(UnderConditions(request_, std::move(response)));
  return Next::kAnswer;
}

Session::Next Session::BeginWait(Wait wait) {
  if (request_.waited || route_->body != BodyKind::kNone) {
    throw std::logic_error("route " + route_->name + " cannot wait here");
  }
  const int waiting = ++context_.waiting;
  wait_ = {new Wait(std::move(wait)), [&counter = context_.waiting](Wait* ended) {
             --counter;
             delete ended;
           }};
  if (waiting > context_.options.max_connections / kWaitingShare) {
    throw ProblemError("busy", "Too many requests are waiting. Try again without waiting.",
                       {.retry_after_s = 5});
  }
  return Next::kEvent;
}

void Session::Refuse(const Problem& problem, std::uint64_t body_bytes) {
  record_.bytes_in = body_bytes;
  keeps_open_ = false;
  AnswerProblem(problem);
}

void Session::AnswerProblem(const Problem& problem) {
  record_.code = problem.code;
  record_.internal = problem.internal;
  MakeAnswer(ProblemResponse(problem, request_.id));
}

void Session::MakeAnswer(Response response) {
  context_.compressor.Compress(request_, response);
  const std::uint64_t bytes = response.file ? response.file->size() : response.body.size();
  // The rest of the connection cannot be read where the body is still on its way.
  answer_.keeps_open = keeps_open_ && !context_.stopping &&
                       (request_.framing == BodyFraming::kNone || has_whole_body_);
  answer_.text = HeadOf(response, bytes);
  if (record_.method != "HEAD") {
    answer_.file = std::move(response.file);
    answer_.text += response.body;
  }
  record_.status = response.status;
  record_.bytes_out = bytes;
  record_.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begun_).count();
  context_.options.on_request(record_);
}

std::string Session::HeadOf(const Response& response, std::uint64_t bytes) const {
  std::string head =
      fmt::format("HTTP/1.1 {} {}\r\n", response.status, StatusTitle(response.status));
  const auto add = [&](std::string_view name, std::string_view value) {
    if (value.find_first_of("\r\n") == std::string_view::npos) {  // else it would be several
      head.append(name).append(": ").append(value).append("\r\n");
    }
  };
  const auto add_default = [&](const char* name, const char* value) {
    if (response.header(name).empty()) add(name, value);
  };
  if (!response.content_type.empty()) add("Content-Type", response.content_type);
  // RFC 9110, section 8.6: these have no content, so they have no length either.
  if (response.status != 204 && response.status != 304) {
    add("Content-Length", std::to_string(bytes));
  }
  for (const auto& [name, value] : response.headers) {
    const bool is_link = name == "Link" && value.starts_with("</");
    const bool is_place =
        (name == "Location" || name == "Content-Location") && value.starts_with('/');
    add(name, is_link    ? "<" + request_.base_path + value.substr(1)
              : is_place ? request_.base_path + value
                         : value);
  }
  for (const auto& [name, value] : request_.answer_headers) add(name, value);
  add("X-Request-Id", request_.id);
  // No answer is meant to be run, framed or loaded by pages of other sites; the page sets rules of
  // its own.
  add("X-Content-Type-Options", "nosniff");
  add_default("Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'");
  add_default("Referrer-Policy", "no-referrer");
  if (request_.is_https) add("Strict-Transport-Security", "max-age=31536000");
  for (const auto& [name, value] : context_.origins.Headers(request_)) add(name, value);
  if (!answer_.keeps_open) {
    add("Connection", "close");
  } else {
    if (request_.is_http_1_0) add("Connection", "keep-alive");
    const auto idle = std::chrono::ceil<std::chrono::seconds>(context_.options.idle_timeout);
    add("Keep-Alive", fmt::format("timeout={}, max={}", idle.count(), kMostRequestsPerConnection));
  }
  return head + "\r\n";
}

}  // namespace pliant::server
