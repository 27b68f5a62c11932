// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The head of a request, against a second reader that only counts.
#include <algorithm>
#include <cctype>

#include "server/http/request_reader.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::fuzz::Require;
using pliant::server::BodyFraming;
using pliant::server::EndOfHead;

// Lines that begin with `field`, in any case.
int CountLines(const std::string& lower, const std::string& field) {
  int count = 0;
  const std::string wanted = "\r\n" + field;
  for (std::size_t at = lower.find(wanted); at != std::string::npos;
       at = lower.find(wanted, at + 1)) {
    ++count;
  }
  return count;
}

void CheckAccepted(std::string_view head, const pliant::server::Request& read) {
  std::string lower(head);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const int lengths = CountLines(lower, "content-length");
  const int encodings = CountLines(lower, "transfer-encoding");
  // Names that only begin like these are counted, too, so this is one-sided.
  Require(read.framing != BodyFraming::kLength || lengths > 0, "a length is given");
  Require(read.framing != BodyFraming::kChunked || encodings > 0, "chunks are announced");
  Require(CountLines(lower, "content-length:") + CountLines(lower, "transfer-encoding:") <= 1,
          "the length is given once");
  Require(CountLines(lower, " ") + CountLines(lower, "\t") == 0, "no line is folded");
  Require(lower.find('\0') == std::string::npos, "no head has zeros");
  for (std::size_t at = 0; at < head.size(); ++at) {
    const bool after_cr = at > 0 && head[at - 1] == '\r';
    Require((head[at] == '\n') == after_cr, "CR and LF come together");
  }
  Require((read.framing == BodyFraming::kLength) == (read.length > 0), "a length is not zero");
}

// However it arrives, a head ends at the same place.
void CheckEnd(std::string_view received) {
  const std::size_t end = EndOfHead(received, 0);
  Require(end == std::string_view::npos ||
              (end >= 4 && end <= received.size() && received.substr(end - 4, 4) == "\r\n\r\n"),
          "an empty line ends a head");
  for (std::size_t part = 0; part <= received.size(); part += 1 + received.size() / 16) {
    const std::size_t early = EndOfHead(received.substr(0, part), 0);
    Require(early == (end <= part ? end : std::string_view::npos), "a part has the same end");
    if (early == std::string_view::npos) {
      Require(EndOfHead(received, part) == end, "the search goes on where it was");
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = pliant::fuzz::TextOf({data, size});
  CheckEnd(text);
  const std::size_t end = std::min(EndOfHead(text, 0), text.size());
  for (const std::string_view head : {text.substr(0, end), text}) {
    pliant::server::Request read;
    try {
      pliant::server::ReadRequestHead(head, read);
      CheckAccepted(head, read);
    } catch (const pliant::server::ProblemError&) {  // refused
    }
  }
  return 0;
}
