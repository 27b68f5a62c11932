// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ends requests whose time is over or which are no longer wanted: the HTTP library has limits for
// each read and write only. One thread for all requests of a pool.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <list>
#include <mutex>
#include <stop_token>
#include <thread>

namespace pliant::clickhouse {

struct WatchedRequest {
  std::chrono::steady_clock::time_point deadline;
  std::stop_token stop;
  std::function<void()> end;
};

class RequestWatch {
 public:
  using Clock = std::chrono::steady_clock;

  RequestWatch();
  ~RequestWatch();
  RequestWatch(const RequestWatch&) = delete;
  RequestWatch& operator=(const RequestWatch&) = delete;

  // While it lives, `end` is called again and again (from the watch's thread) once `deadline` has
  // passed or `stop` was requested, and not after it is gone.
  class Guard {
   public:
    Guard(RequestWatch& watch, Clock::time_point deadline, const std::stop_token& stop,
          std::function<void()> end);
    ~Guard();
    Guard(const Guard&) = delete;
    Guard& operator=(const Guard&) = delete;

   private:
    struct Wake {
      RequestWatch* watch;
      void operator()() const { watch->Hurry(); }
    };

    RequestWatch& watch_;
    std::list<WatchedRequest>::iterator place_;
    std::stop_callback<Wake> wake_;
  };

 private:
  void Hurry();
  void Run();

  std::mutex mutex_;  // guards all below but the thread
  std::condition_variable changed_;
  std::list<WatchedRequest> requests_;
  bool hurry_ = false;
  bool closing_ = false;
  std::thread thread_;
};

}  // namespace pliant::clickhouse
