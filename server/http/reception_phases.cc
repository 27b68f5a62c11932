// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What becomes of one guest of the reception, phase by phase.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <exception>

#include <sys/epoll.h>

#include "server/http/exchange.h"
#include "server/http/reception.h"

namespace pliant::server {

namespace {

constexpr std::chrono::milliseconds kLingerTime{1'000};
constexpr std::uint64_t kSlowestFile = 32 * 1024;  // bytes a second of a long answer or body

// What those may take beside the time for any.
std::chrono::seconds TimeFor(std::uint64_t bytes) {
  constexpr std::uint64_t kMostSeconds = 30 * 24 * 3600;
  return std::chrono::seconds(std::min(bytes / kSlowestFile, kMostSeconds));
}

}  // namespace

void Reception::Enter(Guests::iterator guest, Phase phase) {
  const ConnectionLimits& limits = options_.limits;
  Guest& g = guest->second;
  g.phase = phase;
  const Clock::time_point now = Clock::now();
  switch (phase) {
    case Phase::kGreeting:
      SetDeadline(guest, g.visit->greet_by);
      break;
    case Phase::kHead:
      SetDeadline(guest, now + limits.header_timeout);
      break;
    case Phase::kIdle:
      SetDeadline(guest, now + limits.idle_timeout);
      break;
    case Phase::kBody:
      g.last_deadline = now + limits.body_timeout + TimeFor(g.visit->connection->sink_left());
      SetDeadline(guest, now + limits.body_timeout);
      break;
    case Phase::kWaiting:
      SetDeadline(guest, g.visit->exchange->wait().until);
      break;
    case Phase::kSending:
      g.last_deadline = now + limits.answer_timeout + TimeFor(g.visit->connection->file_left());
      SetDeadline(guest, now + limits.write_timeout);
      break;
    case Phase::kLingering:
      SetDeadline(guest, now + kLingerTime);
      break;
  }
}

void Reception::SetDeadline(Guests::iterator guest, Clock::time_point deadline) {
  deadlines_.erase({guest->second.deadline, guest->first});
  guest->second.deadline = deadline;
  deadlines_.emplace(deadline, guest->first);
}

void Reception::Proceed(Guests::iterator guest) {
  const int fd = guest->first;
  try {
    while (Step(guest)) {
    }
  } catch (const std::exception&) {  // no memory: for this client, not for all
    if (const auto left = guests_.find(fd); left != guests_.end()) Remove(left);
  }
}

// True: the guest is in another phase, whose first step can be taken.
bool Reception::Step(Guests::iterator guest) {
  Connection& connection = *guest->second.visit->connection;
  switch (guest->second.phase) {
    case Phase::kGreeting:
      host_.OnGreeting(HandOver(guest));
      return false;
    case Phase::kIdle:
    case Phase::kHead:
      return ReceiveHead(guest);
    case Phase::kBody: {
      const std::size_t before = connection.body_bytes();
      const auto step = connection.ReceiveBody();
      if (step == Connection::Step::kDone) return Arrived(guest);
      // A long body that comes along gets more time, up to that for the whole; of one in chunks, up
      // to that for what has come.
      if (connection.receives_into_sink() && connection.body_bytes() > before) {
        const auto earned = TimeFor(connection.is_chunked() ? connection.body_bytes() : 0);
        SetDeadline(guest, std::min(guest->second.last_deadline + earned,
                                    Clock::now() + options_.limits.body_timeout));
      }
      return After(guest, step);
    }
    case Phase::kWaiting:  // the client ended its side, or the connection broke
      EndWait(guest);
      return false;
    case Phase::kSending:
      return Send(guest);
    case Phase::kLingering:
      return After(guest, connection.Swallow());
  }
  return false;
}

bool Reception::ReceiveHead(Guests::iterator guest) {
  Guest& g = guest->second;
  const auto step = g.visit->connection->ReceiveHead();
  if (step == Connection::Step::kOver) return After(guest, step);
  if (g.phase == Phase::kIdle && g.visit->connection->has_bytes()) {
    g.visit->begun = Clock::now();
    Enter(guest, Phase::kHead);
  }
  return step == Connection::Step::kDone ? Arrived(guest) : After(guest, step);
}

// A head or a body is there, or is refused.
bool Reception::Arrived(Guests::iterator guest) {
  if (guest->second.visit->connection->fault() != Connection::Fault::kNone) {
    Answer(guest);
    return true;
  }
  host_.OnArrival(HandOver(guest));
  return false;
}

void Reception::AwaitEvent(Guests::iterator guest) {
  Guest& g = guest->second;
  g.ticket = ++last_ticket_;
  waiting_.emplace(g.ticket, guest->first);
  Enter(guest, Phase::kWaiting);
  // What the client sends meanwhile is its next request: it has time.
  epoll_event event{};
  event.events = EPOLLRDHUP | EPOLLONESHOT;
  event.data.fd = guest->first;
  epoll_ctl(poll_fd_, EPOLL_CTL_MOD, guest->first, &event);
  try {
    g.subscription = g.visit->exchange->wait().subscribe([this, ticket = g.ticket] {
      const std::lock_guard lock(mutex_);
      woken_.push_back(ticket);
      Wake();
    });
  } catch (const std::exception&) {  // no memory: for this client, not for all
    Remove(guest);
  }
}

void Reception::EndWait(Guests::iterator guest) {
  waiting_.erase(guest->second.ticket);
  guest->second.subscription.reset();
  host_.OnArrival(HandOver(guest));
}

bool Reception::Send(Guests::iterator guest) {
  Guest& g = guest->second;
  Connection& connection = *g.visit->connection;
  const auto step = connection.Send();
  if (step != Connection::Step::kDone) {
    // Whoever takes something gets more time, up to that for the whole answer.
    if (step != Connection::Step::kOver) {
      SetDeadline(guest, std::min(g.last_deadline, Clock::now() + options_.limits.write_timeout));
    }
    return After(guest, step);
  }
  switch (ending_ && g.after == Next::kRequest ? Next::kEnd : g.after) {
    case Next::kRequest:
      Enter(guest, Phase::kIdle);
      return true;
    case Next::kBody:
      Enter(guest, Phase::kBody);
      return true;
    case Next::kLinger:
      connection.EndSending();
      Enter(guest, Phase::kLingering);
      return true;
    case Next::kGreet:
    case Next::kEvent:
    case Next::kEnd:
      break;
  }
  connection.Farewell();
  Remove(guest);
  return false;
}

bool Reception::After(Guests::iterator guest, Connection::Step step) {
  if (step == Connection::Step::kDone) return true;
  if (step == Connection::Step::kOver) {
    guest->second.visit->connection->Farewell();  // the client ended it
    Remove(guest);
  } else {
    Await(guest, step);
  }
  return false;
}

void Reception::Await(Guests::iterator guest, Connection::Step step) {
  epoll_event event{};
  // One shot: a client that sends while its answer is being sent must not spin the loop.
  event.events = (step == Connection::Step::kWantsOutput ? EPOLLOUT : EPOLLIN) | EPOLLONESHOT;
  event.data.fd = guest->first;
  epoll_ctl(poll_fd_, EPOLL_CTL_MOD, guest->first, &event);
}

void Reception::Answer(Guests::iterator guest) {
  host_.OnFault(*guest->second.visit);
  guest->second.visit->exchange.reset();
  guest->second.after = Next::kLinger;
  Enter(guest, Phase::kSending);
}

std::unique_ptr<Visit> Reception::HandOver(Guests::iterator guest) {
  const int fd = guest->first;
  {
    const std::lock_guard lock(mutex_);
    away_.insert(fd);
  }
  std::unique_ptr<Visit> visit = std::move(guest->second.visit);
  epoll_ctl(poll_fd_, EPOLL_CTL_DEL, fd, nullptr);
  deadlines_.erase({guest->second.deadline, fd});
  guests_.erase(guest);
  return visit;
}

void Reception::OnDeadline(Guests::iterator guest) {
  Guest& g = guest->second;
  if (g.phase == Phase::kWaiting) return EndWait(guest);
  if (g.phase != Phase::kHead && g.phase != Phase::kBody) {
    Remove(guest);  // nobody to tell, or nothing to say
    return;
  }
  g.visit->connection->SetFault(Connection::Fault::kTimeout);
  Answer(guest);
  Proceed(guest);
}

}  // namespace pliant::server
