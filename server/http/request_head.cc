// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/request_head.h"

#include <algorithm>
#include <limits>

namespace pliant::server {

namespace {

constexpr std::size_t kMostSizeLineBytes = 1024;

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

char Lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

bool IsName(std::string_view text, std::string_view lower_name) {
  return std::equal(text.begin(), text.end(), lower_name.begin(), lower_name.end(),
                    [](char a, char b) { return Lower(a) == b; });
}

std::string_view Trimmed(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

int HexDigit(char c) {
  if (IsDigit(c)) return c - '0';
  const char lower = Lower(c);
  return lower >= 'a' && lower <= 'f' ? lower - 'a' + 10 : -1;
}

class HeadReader {
 public:
  RequestHead Read(std::string_view head) {
    bool first = true;
    while (head_.fault.empty() && !head.empty()) {
      const std::size_t end = head.find('\n');
      if (end == std::string_view::npos || end == 0 || head[end - 1] != '\r') {
        head_.fault = "A line of the head does not end in CR LF.";
        break;
      }
      const std::string_view line = head.substr(0, end - 1);
      head.remove_prefix(end + 1);
      if (std::any_of(line.begin(), line.end(), IsControl)) {
        head_.fault = "The head holds control characters.";
      } else if (first) {
        ReadRequestLine(line);
      } else if (!line.empty()) {
        ReadField(line);
      }
      first = false;
    }
    if (lengths_ > 1 || encodings_ > 1 || (lengths_ > 0 && encodings_ > 0) ||
        (old_ && encodings_ > 0)) {
      head_.fault = "The length of the body is ambiguous.";
    }
    return head_;
  }

 private:
  // METHOD SP target SP HTTP/1.x; what else is wrong with it the library says.
  void ReadRequestLine(std::string_view line) {
    const std::size_t first = line.find(' ');
    const std::size_t last = line.rfind(' ');
    if (first == std::string_view::npos || first == last) return;
    head_.target = line.substr(first + 1, last - first - 1);
    old_ = line.substr(last + 1) != "HTTP/1.1";
    if (head_.target.find(' ') != std::string::npos || !IsToken(line.substr(0, first))) {
      head_.fault = "The request line is no \"METHOD target HTTP/1.1\".";
    }
  }

  void ReadField(std::string_view line) {
    if (line.front() == ' ' || line.front() == '\t') {
      head_.fault = "A header field is folded over several lines.";
      return;
    }
    const std::size_t colon = line.find(':');
    const std::string_view name = line.substr(0, colon);
    if (colon == std::string_view::npos || !IsToken(name)) {
      head_.fault = "A header field has no name, or one with characters that names do not have.";
      return;
    }
    const std::string_view value = Trimmed(line.substr(colon + 1));
    if (IsName(name, "content-length")) ReadLength(value);
    if (IsName(name, "transfer-encoding")) {
      ++encodings_;
      if (IsName(value, "chunked")) head_.framing = BodyFraming::kChunked;
    }
  }

  void ReadLength(std::string_view value) {
    ++lengths_;
    if (value.empty() || !std::all_of(value.begin(), value.end(), IsDigit)) {
      head_.fault = "Content-Length is not a number.";
      return;
    }
    constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max() / 16;
    for (const char digit : value) {
      head_.length = std::min(kMost, head_.length * 10 + static_cast<std::uint64_t>(digit - '0'));
    }
    if (head_.length > 0) head_.framing = BodyFraming::kLength;
  }

  RequestHead head_;
  bool old_ = false;  // HTTP/1.0, which has no chunks (section 6.1)
  int lengths_ = 0;
  int encodings_ = 0;
};

}  // namespace

RequestHead ReadRequestHead(std::string_view head) { return HeadReader().Read(head); }

void HideRange(std::span<char> head) {
  const std::string_view text(head.data(), head.size());
  constexpr std::string_view kField = "\nrange:";
  for (auto at = text.find('\n'); at != std::string_view::npos; at = text.find('\n', at + 1)) {
    const std::string_view line = text.substr(at, kField.size());
    if (!std::equal(line.begin(), line.end(), kField.begin(), kField.end(),
                    [](char a, char b) { return Lower(a) == b; })) {
      continue;
    }
    std::copy_n(kHiddenRange, kField.size() - 2,
                head.begin() + static_cast<std::ptrdiff_t>(at) + 1);
  }
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

}  // namespace pliant::server
