// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/reception.h"

#include <algorithm>
#include <array>

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/http/exchange.h"

namespace pliant::server {

namespace {

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
  std::vector<std::uint64_t> woken;
  bool closed = false;
  {
    const std::lock_guard lock(mutex_);
    admitted.swap(admitted_);
    returned.swap(returned_);
    woken.swap(woken_);
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
  if (closed) {
    while (!guests_.empty()) Remove(guests_.begin());
    const std::lock_guard lock(mutex_);
    drained_ = true;
    changed_.notify_all();
    return;
  }
  WakeWaiting(woken);
  if (ending_) EndIdle();
}

void Reception::WakeWaiting(const std::vector<std::uint64_t>& tickets) {
  for (const std::uint64_t ticket : tickets) {
    const auto waiting = waiting_.find(ticket);
    if (waiting != waiting_.end()) EndWait(guests_.find(waiting->second));
  }
}

void Reception::EndIdle() {
  std::vector<int> idle;
  for (const auto& [fd, guest] : guests_) {
    if (guest.phase == Phase::kGreeting || guest.phase == Phase::kIdle) idle.push_back(fd);
  }
  for (const int fd : idle) Remove(guests_.find(fd));
  while (!waiting_.empty()) EndWait(guests_.find(waiting_.begin()->second));
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
  visit->greet_by = Clock::now() + options_.limits.header_timeout;
  const auto guest = Place(std::move(visit));
  if (guest->second.visit->connection->encrypted()) {
    Enter(guest, Phase::kGreeting);
    Await(guest, Connection::Step::kWantsInput);
  } else {
    Enter(guest, Phase::kIdle);
    Proceed(guest);
  }
}

Reception::Guests::iterator Reception::Place(std::unique_ptr<Visit> visit) {
  const int fd = visit->connection->socket();
  const auto guest = guests_.emplace(fd, Guest{}).first;
  guest->second.visit = std::move(visit);
  epoll_event event{};
  event.data.fd = fd;
  epoll_ctl(poll_fd_, EPOLL_CTL_ADD, fd, &event);
  return guest;
}

void Reception::Continue(std::unique_ptr<Visit> visit, Next next) {
  const auto guest = Place(std::move(visit));
  if (next == Next::kGreet) {
    const auto step = guest->second.visit->greeting;
    Enter(guest, step == Connection::Step::kDone ? Phase::kIdle : Phase::kGreeting);
    if (After(guest, step)) Proceed(guest);
    return;
  }
  if (next == Next::kEvent) return AwaitEvent(guest);
  guest->second.after = next;
  // Before a body there may be a "100 Continue" to send.
  Enter(guest, Phase::kSending);
  Proceed(guest);
}

void Reception::Remove(Guests::iterator guest) {
  deadlines_.erase({guest->second.deadline, guest->first});
  waiting_.erase(guest->second.ticket);
  guest->second.subscription.reset();
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
