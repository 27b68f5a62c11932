// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/request_head.h"

#include <algorithm>
#include <array>
#include <limits>

#include "descriptor/base/strings.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMostLineBytes = 8192;
constexpr std::size_t kMostSizeLineBytes = 1024;
constexpr std::array<std::string_view, 9> kMethods = {
    "GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "CONNECT"};

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// RFC 9110, section 5.6.2.
bool IsTokenCharacter(char c) {
  return IsDigit(c) || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
         std::string_view("!#$%&'*+-.^_`|~").find(c) != std::string_view::npos;
}

bool IsToken(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), IsTokenCharacter);
}

bool IsControl(char c) { return (static_cast<unsigned char>(c) < ' ' && c != '\t') || c == 0x7F; }

int HexDigit(char c) {
  if (IsDigit(c)) return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

// Each returns what is wrong; empty = nothing.

std::string ReadRequestLine(std::string_view line, RequestHead& head) {
  const std::size_t first = line.find(' ');
  const std::size_t last = line.rfind(' ');
  const std::string_view method = line.substr(0, first);
  const std::string_view version = line.substr(last == std::string_view::npos ? 0 : last + 1);
  head.is_http_1_0 = version == "HTTP/1.0";
  if (first == last || (version != "HTTP/1.1" && !head.is_http_1_0) ||
      line.substr(0, last).rfind(' ') != first) {
    return "The request line is no \"METHOD target HTTP/1.1\".";
  }
  if (std::find(kMethods.begin(), kMethods.end(), method) == kMethods.end()) {
    return "The method is unknown.";
  }
  head.method = method;
  head.target = line.substr(first + 1, last - first - 1);
  return {};
}

std::string ReadLength(std::string_view value, RequestHead& head) {
  if (value.empty() || !std::all_of(value.begin(), value.end(), IsDigit)) {
    return "Content-Length is not a number.";
  }
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max() / 16;
  for (const char digit : value) {
    head.length = std::min(kMost, head.length * 10 + static_cast<std::uint64_t>(digit - '0'));
  }
  if (head.length > 0) head.framing = BodyFraming::kLength;
  return {};
}

std::string ReadField(std::string_view line, RequestHead& head) {
  if (line.size() > kMostLineBytes) return "A header field is too long.";
  if (line.front() == ' ' || line.front() == '\t') {
    return "A header field is folded over several lines.";
  }
  const std::size_t colon = line.find(':');
  const std::string_view name = line.substr(0, colon);
  if (colon == std::string_view::npos || !IsToken(name)) {
    return "A header field has no name, or one with characters that names do not have.";
  }
  head.fields.emplace(name, Trimmed(line.substr(colon + 1)));
  return {};
}

// Sections 6.1 and 6.3: one length, or chunks, never both; HTTP/1.0 has no chunks.
std::string ReadFraming(RequestHead& head) {
  const auto length = head.fields.find("Content-Length");
  const auto encoding = head.fields.find("Transfer-Encoding");
  const bool has_length = length != head.fields.end();
  const bool has_encoding = encoding != head.fields.end();
  if (head.fields.count("Content-Length") > 1 || head.fields.count("Transfer-Encoding") > 1 ||
      (has_encoding && (has_length || head.is_http_1_0))) {
    return "The length of the body is ambiguous.";
  }
  if (has_encoding) {
    const bool chunked = EqualsIgnoringCase(encoding->second, "chunked");
    head.framing = chunked ? BodyFraming::kChunked : BodyFraming::kUnknown;
  }
  return has_length ? ReadLength(length->second, head) : "";
}

}  // namespace

RequestHead ReadRequestHead(std::string_view text) {
  RequestHead head;
  bool first = true;
  while (head.fault.empty() && !text.empty()) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos || end == 0 || text[end - 1] != '\r') {
      head.fault = "A line of the head does not end in CR LF.";
      break;
    }
    const std::string_view line = text.substr(0, end - 1);
    text.remove_prefix(end + 1);
    if (std::any_of(line.begin(), line.end(), IsControl)) {
      head.fault = "The head holds control characters.";
    } else if (first) {
      head.fault = ReadRequestLine(line, head);
    } else if (!line.empty()) {
      head.fault = ReadField(line, head);
    }
    first = false;
  }
  if (head.fault.empty()) head.fault = ReadFraming(head);
  return head;
}

std::size_t EndOfHead(std::string_view received, std::size_t from) {
  const std::size_t end = received.find("\r\n\r\n", from < 3 ? 0 : from - 3);
  return end == std::string_view::npos ? end : end + 4;
}

// One character of "SIZE [;extension] CR LF". The size is hexadecimal and nothing else: no sign, no
// "0x", no spaces, of which some programs take one and some another.
ChunkedBody::State ChunkedBody::TakeSize(char c) {
  if (++line_bytes_ > kMostSizeLineBytes) return State::kBroken;
  if (part_ == Part::kSizeEnd) {
    if (c != '\n' || digits_ == 0) return State::kBroken;
    part_ = left_ == 0 ? Part::kLastCr : Part::kData;
    return State::kGoesOn;
  }
  if (c == '\r') {
    part_ = Part::kSizeEnd;
    return State::kGoesOn;
  }
  if (part_ == Part::kExtension) return IsControl(c) ? State::kBroken : State::kGoesOn;
  if (c == ';' && digits_ > 0) {
    part_ = Part::kExtension;
    return State::kGoesOn;
  }
  const int digit = HexDigit(c);
  if (digit < 0) return State::kBroken;
  ++digits_;
  left_ = left_ * 16 + static_cast<std::uint64_t>(digit);
  if (left_ > most_bytes_ || total_ + left_ > most_bytes_) return State::kTooLarge;
  return State::kGoesOn;
}

ChunkedBody::State ChunkedBody::Take(std::string_view bytes, std::size_t* used,
                                     std::string* content) {
  std::size_t at = 0;
  const auto expect = [&](char wanted, Part next) {
    part_ = next;
    return bytes[at++] == wanted;
  };
  State state = State::kGoesOn;
  while (state == State::kGoesOn && at < bytes.size()) {
    bool right = true;
    switch (part_) {
      case Part::kSize:
      case Part::kExtension:
      case Part::kSizeEnd:
        state = TakeSize(bytes[at++]);
        if (part_ == Part::kData) total_ += left_;
        break;
      case Part::kData: {
        const std::size_t here = std::min<std::uint64_t>(left_, bytes.size() - at);
        if (content != nullptr) content->append(bytes.substr(at, here));
        at += here;
        left_ -= here;
        if (left_ == 0) part_ = Part::kDataCr;
        break;
      }
      case Part::kDataCr:
        right = expect('\r', Part::kDataLf);
        break;
      case Part::kDataLf:
        right = expect('\n', Part::kSize);
        digits_ = 0;
        line_bytes_ = 0;
        break;
      case Part::kLastCr:  // trailer fields are not taken
        right = expect('\r', Part::kLastLf);
        break;
      case Part::kLastLf:
        right = expect('\n', Part::kSize);
        if (right) state = State::kEnded;
        break;
    }
    if (!right) state = State::kBroken;
  }
  *used = at;
  return state;
}

std::string FieldParameter(std::string_view field, std::string_view name) {
  std::size_t at = field.find(';');
  while (at != std::string_view::npos) {
    const std::size_t equals = field.find('=', at);
    if (equals == std::string_view::npos) break;
    const std::string_view found = Trimmed(field.substr(at + 1, equals - at - 1));
    const bool quoted = field.substr(equals + 1, 1) == "\"";
    const std::size_t begin = equals + (quoted ? 2 : 1);
    std::size_t end = field.find(quoted ? '"' : ';', begin);
    while (quoted && end != std::string_view::npos && field[end - 1] == '\\') {
      end = field.find('"', end + 1);
    }
    const std::string_view value = field.substr(begin, end - begin);
    if (EqualsIgnoringCase(found, name)) return std::string(quoted ? value : Trimmed(value));
    at = field.find(';', end);
  }
  return {};
}

}  // namespace pliant::server
