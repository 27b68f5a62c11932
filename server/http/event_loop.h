// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One thread that waits for many sockets (epoll), for deadlines, and for tasks of other threads.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <set>
#include <thread>
#include <unordered_map>
#include <utility>
#include <vector>

#include "index/files/durable_file.h"

namespace pliant::server {

using Clock = std::chrono::steady_clock;

class EventLoop {
 public:
  using Handler = std::function<void(bool timed_out)>;
  static constexpr Clock::time_point kNever = Clock::time_point::max();

  EventLoop();
  ~EventLoop();  // runs the tasks so far and ends the thread; handlers are dropped

  // Runs `task` on the loop's thread. From any thread.
  void Post(std::function<void()> task);

  // The others are called on the loop's thread only. Handlers and tasks must not wait or throw.
  void Add(int fd, Handler handler);
  void Remove(int fd);
  // Calls the handler once, when one of `events` (EPOLLIN and so on) happens.
  void Await(int fd, std::uint32_t events);
  // Calls the handler once, at that time. A socket has one deadline.
  void SetDeadline(int fd, Clock::time_point deadline);

 private:
  struct Entry {
    Handler handler;
    Clock::time_point deadline = kNever;
  };

  void Run();
  void RunTasks();
  void Call(int fd, bool timed_out);
  void Control(int operation, int fd, std::uint32_t events) const;
  int MillisecondsToDeadline() const;

  const FileHandle epoll_;
  const FileHandle wake_;
  std::unordered_map<int, Entry> entries_;
  std::set<std::pair<Clock::time_point, int>> deadlines_;

  bool ending_ = false;

  std::mutex mutex_;  // guards tasks_
  std::vector<std::function<void()>> tasks_;
  std::thread thread_;
};

}  // namespace pliant::server
