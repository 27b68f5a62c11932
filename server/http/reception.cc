// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/reception.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <exception>

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/http/exchange.h"

namespace pliant::server {

namespace {

constexpr std::chrono::milliseconds kLingerTime{1'000};
constexpr int kEvents = 64;  // taken from the system at a time

}  // namespace

Visit::Visit(std::unique_ptr<Connection> c) : connection(std::move(c)) {}
Visit::~Visit() { exchange.reset(); }  // it refers to the connection

Reception::Reception(ReceptionOptions options, Host* host)
    : options_(options),
      host_(*host),
      poll_fd_(epoll_create1(EPOLL_CLOEXEC)),
      wake_fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = wake_fd_;
  epoll_ctl(poll_fd_, EPOLL_CTL_ADD, wake_fd_, &event);
  thread_ = std::thread([this] { Run(); });
}

Reception::~Reception() {
  Stop(std::chrono::milliseconds(0));
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  Wake();
  thread_.join();
  close(poll_fd_);
  close(wake_fd_);
}

void Reception::Wake() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t woken = ::write(wake_fd_, &one, sizeof(one));
}

void Reception::Admit(std::unique_ptr<Connection> connection) {
  {
    const std::lock_guard lock(mutex_);
    ++open_;
    admitted_.push_back(std::move(connection));
  }
  Wake();
}

void Reception::Return(std::unique_ptr<Visit> visit, Next next) {
  {
    const std::lock_guard lock(mutex_);
    returned_.emplace_back(std::move(visit), next);
  }
  Wake();
}

std::size_t Reception::Stop(std::chrono::milliseconds deadline) {
  std::unique_lock lock(mutex_);
  stopping_ = true;
  Wake();
  changed_.wait_for(lock, deadline, [&] { return open_ == 0; });
  const std::size_t cut_off = open_;
  closed_ = true;
  for (const int fd : away_) shutdown(fd, SHUT_RDWR);
  Wake();
  // From then on nothing is handed over: the caller may end the threads.
  changed_.wait(lock, [&] { return drained_; });
  return cut_off;
}

void Reception::Run() {
  std::array<epoll_event, kEvents> events{};
  while (true) {
    const int count = epoll_wait(poll_fd_, events.data(), kEvents, MillisecondsToDeadline());
    for (int i = 0; i < count; ++i) {
      if (events[i].data.fd == wake_fd_) {
        std::uint64_t wakes = 0;
        [[maybe_unused]] const ssize_t got = ::read(wake_fd_, &wakes, sizeof(wakes));
      } else if (const auto guest = guests_.find(events[i].data.fd); guest != guests_.end()) {
        Proceed(guest);
      }
    }
    TakeArrivals();
    while (!deadlines_.empty() && deadlines_.begin()->first <= Clock::now()) {
      OnDeadline(guests_.find(deadlines_.begin()->second));
    }
    const std::lock_guard lock(mutex_);
    if (drained_ && admitted_.empty() && returned_.empty() && away_.empty()) break;
  }
  while (!guests_.empty()) Remove(guests_.begin());
}

void Reception::TakeArrivals() {
  std::vector<std::unique_ptr<Connection>> admitted;
  std::vector<std::pair<std::unique_ptr<Visit>, Next>> returned;
  bool closed = false;
  {
    const std::lock_guard lock(mutex_);
    admitted.swap(admitted_);
    returned.swap(returned_);
    for (const auto& [visit, next] : returned) away_.erase(visit->connection->socket());
    ending_ = stopping_;
    closed = closed_;
  }
  for (auto& connection : admitted) {
    if (closed) {
      connection.reset();
      const std::lock_guard lock(mutex_);
      --open_;
    } else {
      Welcome(std::make_unique<Visit>(std::move(connection)));
    }
  }
  for (auto& [visit, next] : returned) {
    if (closed) {
      Leave(*visit);
    } else {
      Continue(std::move(visit), next);
    }
  }
  if (ending_) EndIdle();
  if (!closed) return;
  while (!guests_.empty()) Remove(guests_.begin());
  const std::lock_guard lock(mutex_);
  drained_ = true;
  changed_.notify_all();
}

void Reception::EndIdle() {
  std::vector<int> idle;
  for (const auto& [fd, guest] : guests_) {
    if (guest.phase == Phase::kGreeting || guest.phase == Phase::kIdle) idle.push_back(fd);
  }
  for (const int fd : idle) Remove(guests_.find(fd));
}

void Reception::Welcome(std::unique_ptr<Visit> visit) {
  const std::string& address = visit->connection->address();
  const std::size_t of_address = ++by_address_[address];
  std::size_t open = 0;
  {
    const std::lock_guard lock(mutex_);
    open = open_;
  }
  const std::size_t most = options_.most_per_address;
  if (open > options_.most_connections || (most > 0 && of_address > most)) {
    // Under TLS there is no answer without a greeting first.
    if (!visit->connection->encrypted()) host_.OnCrowd(*visit);
    visit->connection->EndSending();
    Leave(*visit);
    return;
  }
  const int fd = visit->connection->socket();
  const auto guest = guests_.emplace(fd, Guest{}).first;
  guest->second.visit = std::move(visit);
  epoll_event event{};
  event.data.fd = fd;
  epoll_ctl(poll_fd_, EPOLL_CTL_ADD, fd, &event);
  Enter(guest, Phase::kGreeting);
  Proceed(guest);
}

void Reception::Continue(std::unique_ptr<Visit> visit, Next next) {
  const int fd = visit->connection->socket();
  const auto guest = guests_.emplace(fd, Guest{}).first;
  guest->second.visit = std::move(visit);
  guest->second.after = next;
  epoll_event event{};
  event.data.fd = fd;
  epoll_ctl(poll_fd_, EPOLL_CTL_ADD, fd, &event);
  // Before a body there may be a "100 Continue" to send.
  Enter(guest, Phase::kSending);
  Proceed(guest);
}

void Reception::Enter(Guests::iterator guest, Phase phase) {
  const ConnectionLimits& limits = options_.limits;
  Guest& g = guest->second;
  g.phase = phase;
  const Clock::time_point now = Clock::now();
  switch (phase) {
    case Phase::kGreeting:
    case Phase::kHead:
      SetDeadline(guest, now + limits.header_timeout);
      break;
    case Phase::kIdle:
      SetDeadline(guest, now + limits.idle_timeout);
      break;
    case Phase::kBody:
      SetDeadline(guest, now + limits.body_timeout);
      break;
    case Phase::kSending:
      g.last_deadline = now + limits.answer_timeout;
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
  Guest& g = guest->second;
  Connection& connection = *g.visit->connection;
  switch (g.phase) {
    case Phase::kGreeting: {
      const auto step = connection.Greet();
      if (step == Connection::Step::kDone) Enter(guest, Phase::kIdle);
      return After(guest, step);
    }
    case Phase::kIdle:
    case Phase::kHead: {
      const auto step = connection.ReceiveHead();
      if (step == Connection::Step::kDone) {
        if (g.phase == Phase::kIdle) g.visit->begun = Clock::now();
        if (connection.fault() != Connection::Fault::kNone) {
          Answer(guest);
          return true;
        }
        HandOver(guest);
        return false;
      }
      if (step != Connection::Step::kOver && g.phase == Phase::kIdle && connection.has_bytes()) {
        g.visit->begun = Clock::now();
        Enter(guest, Phase::kHead);
      }
      return After(guest, step);
    }
    case Phase::kBody: {
      const auto step = connection.ReceiveBody();
      if (step != Connection::Step::kDone) return After(guest, step);
      if (connection.fault() == Connection::Fault::kNone) {
        HandOver(guest);
        return false;
      }
      Answer(guest);
      return true;
    }
    case Phase::kSending: {
      const auto step = connection.Send();
      if (step == Connection::Step::kDone) {
        if (g.after == Next::kEnd || (g.after == Next::kRequest && ending_)) {
          connection.Farewell();
          Remove(guest);
          return false;
        }
        if (g.after == Next::kLinger) connection.EndSending();
        Enter(guest, g.after == Next::kLinger ? Phase::kLingering
                     : g.after == Next::kBody ? Phase::kBody
                                              : Phase::kIdle);
        return true;
      }
      // Whoever takes something gets more time, up to that for the whole answer.
      if (step != Connection::Step::kOver) {
        SetDeadline(guest, std::min(g.last_deadline, Clock::now() + options_.limits.write_timeout));
      }
      return After(guest, step);
    }
    case Phase::kLingering:
      return After(guest, connection.Swallow());
  }
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

void Reception::HandOver(Guests::iterator guest) {
  std::unique_ptr<Visit> visit = std::move(guest->second.visit);
  const int fd = guest->first;
  epoll_ctl(poll_fd_, EPOLL_CTL_DEL, fd, nullptr);
  deadlines_.erase({guest->second.deadline, fd});
  guests_.erase(guest);
  {
    const std::lock_guard lock(mutex_);
    away_.insert(fd);
  }
  host_.OnArrival(std::move(visit));
}

void Reception::OnDeadline(Guests::iterator guest) {
  Guest& g = guest->second;
  if (g.phase != Phase::kHead && g.phase != Phase::kBody) {
    Remove(guest);  // nobody to tell, or nothing to say
    return;
  }
  g.visit->connection->SetFault(Connection::Fault::kTimeout);
  Answer(guest);
  Proceed(guest);
}

void Reception::Remove(Guests::iterator guest) {
  deadlines_.erase({guest->second.deadline, guest->first});
  const std::unique_ptr<Visit> visit = std::move(guest->second.visit);
  guests_.erase(guest);
  Leave(*visit);
}

// The connection is closed when the caller drops it.
void Reception::Leave(const Visit& visit) {
  const auto of_address = by_address_.find(visit.connection->address());
  if (--of_address->second == 0) by_address_.erase(of_address);
  const std::lock_guard lock(mutex_);
  --open_;
  changed_.notify_all();
}

int Reception::MillisecondsToDeadline() const {
  if (deadlines_.empty()) return -1;
  const auto left =
      std::chrono::ceil<std::chrono::milliseconds>(deadlines_.begin()->first - Clock::now());
  return static_cast<int>(std::clamp<long long>(left.count(), 0, 60'000));
}

}  // namespace pliant::server
