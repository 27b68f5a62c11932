// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/request_reader.h"

#include <algorithm>
#include <array>
#include <limits>

#include <fmt/format.h>

#include "descriptor/base/format_bytes.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/strings.h"
#include "index/files/text.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMostLineBytes = 8192;
constexpr std::size_t kMostSizeLineBytes = 1024;
constexpr std::size_t kMostFields = 100;
constexpr std::size_t kKeptBytes = 64 * 1024;  // of an empty buffer's memory
// Of a body of chunks into a sink, which has a limit of its own: that numbers do not overflow.
constexpr std::uint64_t kMostChunked = std::uint64_t{1} << 50;

bool IsControl(char c) { return (static_cast<unsigned char>(c) < ' ' && c != '\t') || c == 0x7F; }

// A line feed without the carriage return before it: the head may then have no end that counts.
bool HasBareLineFeed(std::string_view text, std::size_t from) {
  for (std::size_t at = text.find('\n', from); at != text.npos; at = text.find('\n', at + 1)) {
    if (at == 0 || text[at - 1] != '\r') return true;
  }
  return false;
}

[[noreturn]] void ThrowBad(const char* why) { throw ProblemError("bad_request", why); }

void ReadRequestLine(std::string_view line, Request& head) {
  constexpr std::array<std::string_view, 9> kMethods = {
      "GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "CONNECT"};
  const std::size_t first = line.find(' ');
  const std::size_t last = line.rfind(' ');
  if (first == last || line.find(' ', first + 1) != last) {
    ThrowBad("The request line must be \"METHOD target HTTP/1.1\".");
  }
  const std::string_view version = line.substr(last + 1);
  head.is_http_1_0 = version == "HTTP/1.0";
  if (version != "HTTP/1.1" && !head.is_http_1_0) ThrowBad("The HTTP version must be 1.1 or 1.0.");
  const auto* method = std::find(kMethods.begin(), kMethods.end(), line.substr(0, first));
  if (method == kMethods.end()) ThrowBad("Unknown HTTP method.");
  head.method = *method;
  head.target = line.substr(first + 1, last - first - 1);
}

void ReadField(std::string_view line, Request& head) {
  if (line.size() > kMostLineBytes) ThrowBad("A header field is too long.");
  if (line.front() == ' ' || line.front() == '\t') {
    ThrowBad("A header field must be on one line.");
  }
  const std::size_t colon = std::min(line.find(':'), line.size());
  const std::string_view name = line.substr(0, colon);
  if (colon == line.size() || name.empty() || !IsNameOf(name, "!#$%&'*+-.^_`|~")) {
    ThrowBad("A header field has no name or an invalid name.");  // RFC 9110, section 5.6.2
  }
  if (head.headers.size() == kMostFields) {
    throw ProblemError("headers_too_large",
                       fmt::format("A request can have at most {} header fields.", kMostFields));
  }
  head.headers.emplace(name, Trimmed(line.substr(colon + 1)));
}

// Sections 6.1 and 6.3: one length, or chunks, never both; HTTP/1.0 has no chunks.
void ReadFraming(Request& head) {
  const std::size_t lengths = head.headers.count("Content-Length");
  const std::size_t encodings = head.headers.count("Transfer-Encoding");
  if (lengths + encodings > 1 || (encodings == 1 && head.is_http_1_0)) {
    ThrowBad("Send either Content-Length or Transfer-Encoding, and only once.");
  }
  if (encodings == 1) {
    if (!EqualsIgnoringCase(head.headers.find("Transfer-Encoding")->second, "chunked")) {
      throw ProblemError("unsupported_transfer_encoding", "The Transfer-Encoding must be chunked.");
    }
    head.framing = BodyFraming::kChunked;
  }
  if (lengths == 1) {
    const auto length = Digits(head.headers.find("Content-Length")->second);
    if (!length) ThrowBad("Content-Length must be a number.");
    head.length = *length;
    if (*length > 0) head.framing = BodyFraming::kLength;
  }
}

}  // namespace

std::optional<std::uint64_t> Digits(std::string_view text) {
  const bool digits = !text.empty() && text.find_first_not_of("0123456789") == text.npos;
  if (!digits) return std::nullopt;
  return NumberOf<std::uint64_t>(text).value_or(std::numeric_limits<std::uint64_t>::max());
}

void ReadRequestHead(std::string_view text, Request& head) {
  for (bool first = true; !text.empty(); first = false) {
    const std::size_t end = text.find('\n');
    if (end == text.npos || end == 0 || text[end - 1] != '\r') {
      ThrowBad("Every header line must end with CR LF.");
    }
    const std::string_view line = text.substr(0, end - 1);
    text.remove_prefix(end + 1);
    if (std::any_of(line.begin(), line.end(), IsControl)) {
      ThrowBad("The headers must not contain control characters.");
    }
    if (first) {
      ReadRequestLine(line, head);
    } else if (!line.empty()) {
      ReadField(line, head);
    }
  }
  ReadFraming(head);
}

std::size_t EndOfHead(std::string_view received, std::size_t from) {
  const std::size_t end = received.find("\r\n\r\n", from < 3 ? 0 : from - 3);
  return end == received.npos ? end : end + 4;
}

// One character that is not content: of "SIZE [;extension] CR LF", or of the line ends. The size is
// hexadecimal and nothing else: no sign, no "0x", no spaces, which some programs take and some not.
ChunkedBody::State ChunkedBody::TakeFraming(char c) {
  if (!line_end_.empty()) {
    if (c != line_end_.front()) return State::kBroken;
    line_end_.remove_prefix(1);
    return line_end_.empty() && is_last_ ? State::kEnded : State::kGoesOn;
  }
  if (c == '\r' && line_bytes_ > 0) {
    total_ += left_;
    is_last_ = left_ == 0;
    line_end_ = is_last_ ? "\n\r\n" : "\n";  // trailer fields are not taken
    line_bytes_ = 0;
    in_extension_ = false;
    return State::kGoesOn;
  }
  if (++line_bytes_ > kMostSizeLineBytes) return State::kBroken;
  if (in_extension_) return IsControl(c) ? State::kBroken : State::kGoesOn;
  if (const int digit = HexValue(c); digit >= 0) {
    left_ = left_ * 16 + static_cast<std::uint64_t>(digit);
    return total_ + left_ > most_bytes_ ? State::kTooLarge : State::kGoesOn;
  }
  in_extension_ = c == ';' && line_bytes_ > 1;  // behind a digit
  return in_extension_ ? State::kGoesOn : State::kBroken;
}

ChunkedBody::State ChunkedBody::Take(std::string_view bytes, std::size_t* used,
                                     std::string* content) {
  State state = State::kGoesOn;
  std::size_t at = 0;
  while (state == State::kGoesOn && at < bytes.size()) {
    if (left_ == 0 || line_bytes_ > 0 || !line_end_.empty()) {
      state = TakeFraming(bytes[at++]);
      continue;
    }
    const std::size_t here = std::min<std::uint64_t>(left_, bytes.size() - at);
    if (content != nullptr) content->append(bytes.substr(at, here));
    at += here;
    left_ -= here;
    if (left_ == 0) line_end_ = "\r\n";
  }
  *used = at;
  return state;
}

bool MemoryBudget::Take(std::size_t bytes) {
  if (used.fetch_add(bytes) + bytes <= most) return true;
  used -= bytes;
  return false;
}

bool RequestReader::HasBytes() {
  while (buffer_.compare(begin_, 2, "\r\n") == 0) begin_ += 2;
  return begin_ < buffer_.size();
}

bool RequestReader::ReadHead() {
  const std::size_t end =
      HasBytes() ? EndOfHead(buffer_, std::max(searched_, begin_)) : std::string::npos;
  const std::size_t known = std::min(end, buffer_.size());
  // Empty lines count, too: a client could send them for ever.
  if (known > max_header_bytes_) {
    throw ProblemError("headers_too_large", fmt::format("The headers can have at most {}.",
                                                        FormatBytes(max_header_bytes_)));
  }
  const bool bare = HasBareLineFeed(std::string_view(buffer_).substr(0, known), searched_);
  searched_ = buffer_.size();
  if (end == std::string::npos && !bare) return false;
  ReadRequestHead(std::string_view(buffer_).substr(begin_, known - begin_), head_);
  buffer_.erase(0, known);
  begin_ = searched_ = 0;
  chunks_ = ChunkedBody(max_body_bytes_);
  return true;
}

void RequestReader::ReceiveInto(std::shared_ptr<BodySink> sink) {
  sink_ = std::move(sink);
  if (sink_) chunks_ = ChunkedBody(kMostChunked);
}

bool RequestReader::ReadBody() {
  if (body_ended_) return true;
  const auto check_size = [&](bool fits) {
    if (fits) return;
    throw ProblemError("body_too_large",
                       fmt::format("A body can have at most {}.", FormatBytes(max_body_bytes_)));
  };
  check_size(sink_ || head_.length <= max_body_bytes_);
  std::size_t used = static_cast<std::size_t>(std::min<std::uint64_t>(body_left(), buffer_.size()));
  std::string_view content = std::string_view(buffer_).substr(0, used);
  auto state = ChunkedBody::State::kGoesOn;
  std::string chunked;
  if (head_.framing == BodyFraming::kChunked) {
    state = chunks_.Take(buffer_, &used, &chunked);
    content = chunked;
  }
  body_bytes_ += content.size();
  framing_bytes_ += used - content.size();
  if (state == ChunkedBody::State::kBroken) ThrowBad("The body is damaged or incomplete.");
  check_size(state != ChunkedBody::State::kTooLarge &&
             framing_bytes_ <= body_bytes_ + 2 * max_body_bytes_);
  PassOn(content);
  buffer_.erase(0, used);
  body_ended_ = head_.framing == BodyFraming::kChunked ? state == ChunkedBody::State::kEnded
                                                       : body_left() == 0;
  return body_ended_;
}

void RequestReader::PassOn(std::string_view content) {
  if (sink_) {
    try {
      return sink_->Append(content);
    } catch (...) {
      throw ProblemError(CurrentProblem());
    }
  }
  if (!budget_->Take(content.size())) {
    throw ProblemError("busy", kTooManyRequests, {.retry_after_s = 2});
  }
  held_ += content.size();
  body_.append(content);
}

void RequestReader::Forget() {
  if (buffer_.capacity() > buffer_.size() + kKeptBytes) buffer_.shrink_to_fit();
  budget_->Give(std::exchange(held_, 0));
  head_ = {};
  body_bytes_ = framing_bytes_ = 0;
  body_ended_ = false;
  body_ = {};
  sink_.reset();
}

}  // namespace pliant::server
