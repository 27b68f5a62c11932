// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Chunked bodies, in one piece and in pieces, and against a second reader. The first byte of an
// input chooses the most bytes of content, the second where it is split.
#include <cctype>
#include <optional>
#include <string>

#include "server/http/request_reader.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::fuzz::Require;
using pliant::server::ChunkedBody;
using State = ChunkedBody::State;

struct Outcome {
  State state = State::kGoesOn;
  std::size_t used = 0;
  std::string content;

  bool operator==(const Outcome&) const = default;
};

// Taken `step` bytes at a time, the first time `first`.
Outcome TakeInPieces(std::string_view text, std::uint64_t most, std::size_t first,
                     std::size_t step) {
  ChunkedBody body(most);
  Outcome outcome;
  std::size_t piece = first;
  while (outcome.state == State::kGoesOn && outcome.used < text.size()) {
    const std::string_view next = text.substr(outcome.used, piece);
    std::size_t used = 0;
    outcome.state = body.Take(next, &used, &outcome.content);
    Require(used <= next.size(), "no more is used than there is");
    Require(outcome.state != State::kGoesOn || used == next.size(), "all is used until the end");
    outcome.used += used;
    piece = step;
  }
  return outcome;
}

// The length of a whole body of at most `most` bytes of content; nothing for what is none. Lines of
// sizes may be of any length here.
std::optional<std::size_t> LengthOf(std::string_view text, std::uint64_t most) {
  std::size_t at = 0;
  std::uint64_t total = 0;
  while (true) {
    const std::size_t line_end = text.find("\r\n", at);
    if (line_end == std::string_view::npos) return std::nullopt;
    std::uint64_t size = 0;
    std::size_t digits = at;
    for (; digits < line_end && std::isxdigit(static_cast<unsigned char>(text[digits])) != 0;
         ++digits) {
      const char c = static_cast<char>(std::tolower(text[digits]));
      size = size * 16 + static_cast<std::uint64_t>(c <= '9' ? c - '0' : c - 'a' + 10);
      if (size + total > most) return std::nullopt;
    }
    if (digits == at || (digits < line_end && text[digits] != ';')) return std::nullopt;
    at = line_end + 2;
    if (text.size() < at + size + 2 || text.substr(at + size, 2) != "\r\n") return std::nullopt;
    at += size + 2;
    if (size == 0) return at;
    total += size;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  pliant::fuzz::Input input(data, size);
  const std::uint64_t most = std::uint64_t{1} << pliant::fuzz::TakeByte(input) % 24;
  const std::size_t split = pliant::fuzz::TakeByte(input);
  const std::string_view text = pliant::fuzz::TextOf(input);
  const Outcome whole = TakeInPieces(text, most, text.size(), text.size());
  Require(TakeInPieces(text, most, 1, 1) == whole, "byte by byte it is the same");
  Require(TakeInPieces(text, most, 1 + split, text.size() + 1) == whole, "in two it is the same");
  Require(TakeInPieces(text, most, 1 + split / 2, 1 + split) == whole, "in many it is the same");
  if (whole.state == State::kEnded) {
    Require(LengthOf(text, most) == whole.used, "a body is what others take for one");
    Require(whole.content.size() <= most, "it has no more content than it may");
  }
  return 0;
}
