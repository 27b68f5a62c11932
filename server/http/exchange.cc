// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/exchange.h"

#include <algorithm>
#include <charconv>
#include <random>

#include <fmt/format.h>

#include "server/http/library.h"
#include "server/http/parameters.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMaxPathBytes = 2048;
constexpr std::size_t kLoggedPathBytes = 256;

bool IsRequestId(const std::string& id) {
  return !id.empty() && id.size() <= 64 && std::all_of(id.begin(), id.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  });
}

std::string NewRequestId() {
  thread_local std::mt19937_64 random{std::random_device{}()};
  return fmt::format("{:016x}", random());
}

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// "Image/PNG; q=1" -> "image/png"
std::string MediaTypeOf(const std::string& content_type) {
  std::string type = content_type.substr(0, content_type.find(';'));
  while (!type.empty() && (type.back() == ' ' || type.back() == '\t')) type.pop_back();
  return Lower(type);
}

std::string Printable(std::string_view text) {
  std::string printable(text.substr(0, kLoggedPathBytes));
  for (char& c : printable) {
    if (c <= ' ' || c > '~') c = '?';
  }
  return printable;
}

}  // namespace

Exchange::Exchange(ExchangeShared& shared, Connection& connection)
    : shared_(shared), connection_(connection) {
  request_.id = NewRequestId();
}

Exchange::~Exchange() { EndWait(); }

void Exchange::ReadHead(const httplib::Request& raw) {
  if (const auto id = raw.get_header_value("X-Request-Id"); IsRequestId(id)) request_.id = id;
  request_.method = raw.method == "HEAD" ? "GET" : raw.method;
  request_.path = raw.target.substr(0, raw.target.find('?'));
  request_.query = {raw.params.begin(), raw.params.end()};
  request_.headers = {raw.headers.begin(), raw.headers.end()};
  if (!accepted_codings_.empty()) request_.headers.emplace("Accept-Encoding", accepted_codings_);
  const auto [begin, end] = raw.headers.equal_range(kHiddenRange);
  for (auto range = begin; range != end && raw.method != "HEAD"; ++range) {
    request_.headers.emplace("Range", range->second);  // RFC 9110, section 14.2: not of HEAD
  }
  request_.remote_address = raw.remote_addr;
  request_.content_type = MediaTypeOf(request_.header("Content-Type"));
  record_.remote_address = raw.remote_addr;
  record_.method = raw.method;
  record_.path = Printable(request_.path);
}

// RFC 9112, section 6: one unmistakable length, or chunks, never both.
void Exchange::CheckFraming(const httplib::Request& raw) {
  const bool has_length = raw.has_header("Content-Length");
  const bool has_encoding = raw.has_header("Transfer-Encoding");
  must_close_ = has_length || has_encoding;  // until the body is read
  if (raw.version == "HTTP/1.1" && raw.get_header_value_count("Host") != 1) {
    throw ProblemError("bad_request", "A request needs exactly one Host header.");
  }
  if (raw.get_header_value_count("Content-Length") > 1 || (has_length && has_encoding)) {
    throw ProblemError("bad_request", "The length of the body is ambiguous.");
  }
  if (has_encoding) {
    if (Lower(raw.get_header_value("Transfer-Encoding")) != "chunked") {
      throw ProblemError("unsupported_transfer_encoding", "Only chunked bodies are taken.");
    }
    request_.has_body = true;
  }
  if (has_length) {
    const std::string text = raw.get_header_value("Content-Length");
    std::uint64_t length = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), length);
    if (error == std::errc::invalid_argument || end != text.data() + text.size()) {
      throw ProblemError("bad_request", "Content-Length is not a number.");
    }
    if (error != std::errc()) throw BodyProblem(true, false);
    length_ = length;
    request_.has_body = length > 0;
    must_close_ = length > 0;
  }
  if (request_.has_body && raw.has_header("Content-Encoding") &&
      Lower(raw.get_header_value("Content-Encoding")) != "identity") {
    throw ProblemError("unsupported_content_encoding", "Compressed bodies are not taken.");
  }
}

bool Exchange::ReceivesItself() const {
  // Chunks may become any number of bytes.
  return route_->receive && length_.value_or(shared_.max_body_bytes + 1) > shared_.max_body_bytes;
}

void Exchange::CheckLength() const {
  if (ReceivesItself()) return;  // BeginReceiving() asks the route
  if (length_.value_or(0) > shared_.max_body_bytes) throw BodyProblem(true, false);
}

// All that can be wrong with the head is said before a long body is sent for nothing.
void Exchange::BeginReceiving() {
  const Parameters parameters(*route_, request_);
  request_.received = route_->receive(request_, length_.value_or(0));
  connection_.ReceiveInto(request_.received);
}

// HTTP/1.0, which no browser speaks, does without the header.
void Exchange::CheckHost() const {
  const auto host = request_.headers.find("Host");
  if (host == request_.headers.end() || shared_.allowed_hosts.Allows(host->second)) return;
  throw ProblemError("host_not_allowed",
                     "The server is not called by the name in the Host header; its operator can "
                     "allow it with --allowed-hosts.");
}

bool Exchange::BeforeBody(const httplib::Request& raw, httplib::Response& answer) {
  if (wait_) {
    EndWait();
    request_.waited = true;
    RunHandler(answer);
  }
  if (prepared_) return complete_;
  prepared_ = true;
  ReadHead(raw);
  try {
    CheckFraming(raw);
    CheckHost();
    if (request_.path.size() > kMaxPathBytes) {
      throw ProblemError("uri_too_long", "The path is too long.");
    }
    if (shared_.origins.IsPreflight(request_)) {
      const auto methods = shared_.router.AllowedMethods(SplitPath(request_.path));
      Answer(OriginPolicy::PreflightAnswer(methods), answer);
      return complete_ = true;
    }
    shared_.origins.CheckSameSite(request_);
    request_.segments = SplitPath(request_.path);
    route_ = &shared_.router.Resolve(request_);
    record_.route = route_->name;
    CheckConditions(*route_, request_);
    shared_.admit(*route_, request_);
    record_.key_id = request_.caller.key_id;
    if (route_->needs_index && shared_.stopping) {
      throw ProblemError("stopping", "The server is being stopped.");
    }
    if (route_->needs_index && !shared_.ready) {
      throw ProblemError("starting", "The index is still loading. Try again shortly.");
    }
    CheckLength();
    CheckContentType(*route_, request_);
    if (request_.has_body && ReceivesItself()) BeginReceiving();
  } catch (...) {
    const Problem problem = CurrentProblem();
    must_close_ = must_close_ || problem.code == "bad_request";  // who knows where the next begins
    AnswerProblem(problem, answer);
    return complete_ = true;
  }
  if (request_.has_body && route_->body != BodyKind::kNone) return false;
  request_.has_body = false;
  RunHandler(answer);
  return complete_ = true;
}

bool Exchange::AwaitsBody(httplib::Response& answer) {
  if (!connection_.body_received()) {
    const bool settled = connection_.ReceiveBody() == Connection::Step::kDone;
    awaits_body_ = !settled || connection_.fault() != Connection::Fault::kNone;
  } else {
    awaits_body_ = false;
  }
  if (!awaits_body_) return false;
  LeaveWithoutAnswer(answer);
  return true;
}

void Exchange::OnLibraryError(const httplib::Request& raw, httplib::Response& answer) {
  if (answered_) return;
  if (!prepared_) ReadHead(raw);
  must_close_ = true;  // whatever it was, the rest of the connection cannot be trusted
  int status = answer.status;
  if (status == 400 && raw.headers.size() >= kMaxHeaderFields) status = 431;
  AnswerProblem(ProblemForStatus(status), answer);
}

void Exchange::OnException(httplib::Response& answer) {
  must_close_ = true;
  AnswerProblem(CurrentProblem(), answer);
}

Problem Exchange::FaultProblem() const {
  switch (connection_.fault()) {
    case Connection::Fault::kHeadersTooLarge:
      return ProblemForStatus(431);
    case Connection::Fault::kBadHead:
      return ProblemError("bad_request", connection_.head().fault).problem();
    case Connection::Fault::kBusy:
      return ProblemError("busy", "Too many requests at the moment. Try again shortly.")
          .RetryAfter(2)
          .problem();
    case Connection::Fault::kTimeout:
      if (!prepared_) return ProblemForStatus(408);
      break;
    case Connection::Fault::kSink:
      try {
        connection_.RethrowSinkError();
      } catch (...) {
        return CurrentProblem();
      }
    case Connection::Fault::kBodyTooLarge:
    case Connection::Fault::kBadBody:
    case Connection::Fault::kNone:
      break;
  }
  return BodyProblem(false, false).problem();
}

void Exchange::NoteAnswer(const httplib::Response& answer) {
  record_.status = answer.status;
  if (!answer.body.empty()) record_.bytes_out = answer.body.size();
}

RequestRecord Exchange::Record(double seconds) const {
  RequestRecord record = record_;
  record.id = request_.id;
  record.seconds = seconds;
  record.bytes_in = connection_.body_bytes();
  return record;
}

}  // namespace pliant::server
