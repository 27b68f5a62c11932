// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Reading requests from what was received, in one piece and in two: what is taken, refused and
// handed on is the same. The first two bytes of an input choose where it is split.
#include <algorithm>
#include <optional>
#include <utility>

#include "server/http/request_reader.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::fuzz::Require;
using pliant::server::BodyFraming;
using pliant::server::Request;
using pliant::server::RequestReader;

constexpr std::size_t kMostInput = 32 * 1024;
constexpr std::size_t kMostHeader = 512;
constexpr std::size_t kMostBody = 4096;

struct Outcome {
  bool accepted = false;
  std::string target;
  pliant::server::HeaderFields fields;
  BodyFraming framing = BodyFraming::kNone;
  std::string body;

  bool operator==(const Outcome&) const = default;
};

// The next request; nothing when it has not arrived as a whole. Throws for one that is refused.
std::optional<Outcome> Next(RequestReader& reader, std::optional<Request>& head) {
  if (!head) {
    if (!reader.ReadHead()) return std::nullopt;
    head = reader.head();
  }
  if (!reader.ReadBody()) return std::nullopt;
  Require(reader.body_left() == 0, "nothing of a body is left");
  Outcome outcome{true, head->target, head->headers, head->framing, reader.TakeBody()};
  Require(outcome.body.size() == reader.body_bytes(), "a body has the bytes that were counted");
  return outcome;
}

// All requests until the first that is refused or cut short.
std::vector<Outcome> Receive(std::string_view text, std::size_t split) {
  pliant::server::MemoryBudget budget{.most = std::size_t{1} << 20};
  std::vector<Outcome> outcomes;
  {
    RequestReader reader(kMostHeader, kMostBody, &budget);
    std::optional<Request> head;
    bool refused = false;
    for (const std::string_view part : {text.substr(0, split), text.substr(split)}) {
      reader.Append(part);
      while (!refused) {
        try {
          const auto outcome = Next(reader, head);
          if (!outcome) break;
          outcomes.push_back(*outcome);
        } catch (const pliant::server::ProblemError&) {
          outcomes.emplace_back();
          refused = true;
        }
        reader.Forget();
        head.reset();
      }
    }
  }
  Require(budget.used == 0, "memory is given back");
  return outcomes;
}

void CheckOutcome(const Outcome& outcome) {
  if (!outcome.accepted) return;
  std::size_t header = outcome.target.size();
  for (const auto& [name, value] : outcome.fields) header += name.size() + value.size() + 4;
  Require(header <= kMostHeader, "no head is longer than the limit");
  Require(outcome.framing != BodyFraming::kNone || outcome.body.empty(), "a body is announced");
  Require(outcome.body.size() <= kMostBody, "no body is longer than the limit");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  pliant::fuzz::Input input(data, std::min(size, kMostInput));
  const std::size_t high = pliant::fuzz::TakeByte(input);
  const std::size_t low = pliant::fuzz::TakeByte(input);
  const std::size_t split = std::min(high * 256 + low, input.size());
  const std::string_view text = pliant::fuzz::TextOf(input);
  const std::vector<Outcome> whole = Receive(text, text.size());
  for (const Outcome& outcome : whole) CheckOutcome(outcome);
  Require(Receive(text, split) == whole, "in two pieces it is the same");
  return 0;
}
