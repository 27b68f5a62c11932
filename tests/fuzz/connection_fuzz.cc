// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Receiving a request from a socket, in one piece and in two: what is taken, refused and handed on
// is the same. The first two bytes of an input choose where it is split.
#include <algorithm>
#include <optional>

#include <sys/socket.h>
#include <unistd.h>

#include "server/http/connection.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::fuzz::Require;
using pliant::server::BodyFraming;
using pliant::server::Connection;

constexpr std::size_t kMostInput = 32 * 1024;  // fits into the buffer of a socket
constexpr std::size_t kMostHeader = 512;
constexpr std::size_t kMostBody = 4096;

struct Outcome {
  bool accepted = false;
  BodyFraming framing = BodyFraming::kNone;
  std::size_t body_bytes = 0;
  std::string handed_on;  // what the HTTP library reads

  bool operator==(const Outcome&) const = default;
};

// The next request of the connection; nothing when it has not arrived as a whole.
std::optional<Outcome> Next(Connection& connection, bool& has_head) {
  using Step = Connection::Step;
  if (!has_head && connection.ReceiveHead() != Step::kDone) return std::nullopt;
  has_head = true;
  Outcome outcome;
  if (connection.fault() != Connection::Fault::kNone) return outcome;
  if (connection.ReceiveBody() != Step::kDone) return std::nullopt;
  if (connection.fault() != Connection::Fault::kNone) return outcome;
  outcome.accepted = true;
  outcome.framing = connection.head().framing;
  outcome.body_bytes = connection.body_bytes();
  connection.Rewind();
  std::string buffer(kMostInput, ' ');
  buffer.resize(static_cast<std::size_t>(connection.read(buffer.data(), buffer.size())));
  outcome.handed_on = std::move(buffer);
  return outcome;
}

// All requests until the first that is refused or cut short.
std::vector<Outcome> Receive(std::string_view text, std::size_t split) {
  const pliant::server::ConnectionLimits limits{.max_header_bytes = kMostHeader,
                                                .max_body_bytes = kMostBody};
  pliant::server::MemoryBudget budget{.most = std::size_t{1} << 20};
  int sockets[2];
  Require(socketpair(AF_UNIX, SOCK_STREAM, 0, sockets) == 0, "there are sockets");
  std::vector<Outcome> outcomes;
  {
    Connection connection(sockets[0], limits, &budget, nullptr);
    bool has_head = false;
    bool refused = false;
    for (const std::string_view part : {text.substr(0, split), text.substr(split)}) {
      Require(part.empty() || send(sockets[1], part.data(), part.size(), MSG_NOSIGNAL) ==
                                  static_cast<ssize_t>(part.size()),
              "an input fits into the socket");
      while (!refused) {
        const auto outcome = Next(connection, has_head);
        if (!outcome) break;
        outcomes.push_back(*outcome);
        refused = !outcome->accepted;
        connection.ForgetRequest();
        has_head = false;
      }
    }
  }
  close(sockets[1]);
  Require(budget.used == 0, "memory is given back");
  return outcomes;
}

void CheckOutcome(const Outcome& outcome) {
  if (!outcome.accepted) return;
  const std::size_t header = outcome.handed_on.size() - outcome.body_bytes;
  Require(header <= kMostHeader, "no head is longer than the limit");
  Require(outcome.handed_on.substr(0, header).ends_with("\r\n\r\n"), "a head has an end");
  Require(outcome.framing == BodyFraming::kChunked || outcome.body_bytes <= kMostBody,
          "no body is longer than the limit");
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
