// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/event_loop.h"

#include <algorithm>
#include <array>

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace pliant::server {

EventLoop::EventLoop()
    : epoll_(epoll_create1(EPOLL_CLOEXEC)), wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  Control(EPOLL_CTL_ADD, wake_.get(), EPOLLIN);
  thread_ = std::thread([this] { Run(); });
}

EventLoop::~EventLoop() {
  Post([this] { ending_ = true; });
  thread_.join();
}

void EventLoop::Control(int operation, int fd, std::uint32_t events) const {
  epoll_event event{.events = events, .data = {.fd = fd}};
  epoll_ctl(epoll_.get(), operation, fd, &event);
}

void EventLoop::Post(std::function<void()> task) {
  {
    const std::lock_guard lock(mutex_);
    tasks_.push_back(std::move(task));
  }
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t woken = ::write(wake_.get(), &one, sizeof(one));
}

void EventLoop::Add(int fd, Handler handler) {
  entries_[fd].handler = std::move(handler);
  Control(EPOLL_CTL_ADD, fd, 0);
}

void EventLoop::Remove(int fd) {
  SetDeadline(fd, kNever);
  Control(EPOLL_CTL_DEL, fd, 0);
  entries_.erase(fd);
}

void EventLoop::Await(int fd, std::uint32_t events) {
  // Once: a client that sends while its answer is being sent must not spin the loop.
  Control(EPOLL_CTL_MOD, fd, events | EPOLLONESHOT);
}

void EventLoop::SetDeadline(int fd, Clock::time_point deadline) {
  const auto entry = entries_.find(fd);
  if (entry == entries_.end()) return;
  deadlines_.erase({entry->second.deadline, fd});
  entry->second.deadline = deadline;
  if (deadline != kNever) deadlines_.emplace(deadline, fd);
}

void EventLoop::Run() {
  constexpr int kEvents = 64;  // taken from the system at a time
  std::array<epoll_event, kEvents> events{};
  while (!ending_) {
    const int count = epoll_wait(epoll_.get(), events.data(), kEvents, MillisecondsToDeadline());
    for (int i = 0; i < count; ++i) {
      if (events[i].data.fd != wake_.get()) {
        Call(events[i].data.fd, /*timed_out=*/false);
        continue;
      }
      std::uint64_t wakes = 0;
      [[maybe_unused]] const ssize_t got = ::read(wake_.get(), &wakes, sizeof(wakes));
    }
    while (!deadlines_.empty() && deadlines_.begin()->first <= Clock::now()) {
      const int fd = deadlines_.begin()->second;
      SetDeadline(fd, kNever);
      Call(fd, /*timed_out=*/true);
    }
    RunTasks();
  }
}

void EventLoop::Call(int fd, bool timed_out) {
  const auto entry = entries_.find(fd);
  if (entry == entries_.end()) return;
  const Handler handler = entry->second.handler;  // a copy: it may remove itself
  handler(timed_out);
}

void EventLoop::RunTasks() {
  std::unique_lock lock(mutex_);
  const auto tasks = std::exchange(tasks_, {});
  lock.unlock();
  for (const auto& task : tasks) task();
}

int EventLoop::MillisecondsToDeadline() const {
  if (deadlines_.empty()) return -1;
  const auto left =
      std::chrono::ceil<std::chrono::milliseconds>(deadlines_.begin()->first - Clock::now());
  return static_cast<int>(std::clamp<long long>(left.count(), 0, 60'000));
}

}  // namespace pliant::server
