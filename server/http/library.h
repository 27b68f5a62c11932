// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The one place that knows how cpp-httplib 0.11 (Debian 12) and 0.18 (Debian 13) differ, and the
// only use of what that library does not promise: a private virtual function, which is the only way
// to serve its connections through a stream of our own. server/CMakeLists.txt sets
// PLIANT_HTTPLIB_MINOR and refuses versions that were not tried.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <utility>

#include <httplib.h>

#ifndef PLIANT_HTTPLIB_MINOR
#error "PLIANT_HTTPLIB_MINOR is not set: build through server/CMakeLists.txt"
#endif

namespace pliant::server {

// Version 0.18 reads no longer lines, nor more header fields, but does not say that this was the
// reason. Connection keeps both versions to the same lines.
constexpr std::size_t kMaxLineBytes = 32 * 1024;
constexpr std::size_t kMaxHeaderFields = 100;

// What httplib::TaskQueue::enqueue() returns: nothing, or since 0.13 whether the task was taken.
using Enqueued = decltype(std::declval<httplib::TaskQueue&>().enqueue({}));

// Runs the library's tasks at once: they only pass accepted connections on.
class PassingQueue final : public httplib::TaskQueue {
 public:
  Enqueued enqueue(std::function<void()> task) override {
    task();
    return Enqueued(true);
  }
  void shutdown() override {}
};

// Owns the accepting loop; what happens on a connection is up to TakeSocket().
class LibraryServer : public httplib::Server {
 protected:
  LibraryServer() {
    new_task_queue = [] { return new PassingQueue; };
  }

  // Takes an accepted connection and owns its socket. Must not wait.
  virtual void TakeSocket(socket_t socket_fd) = 0;

  // Reads one request from `stream` and answers it by the handlers that were set. False: nothing
  // could be read or written. `prepare` is called when the headers are there.
  bool ProcessRequest(httplib::Stream& stream, bool last, bool& client_closes,
                      const std::function<void(httplib::Request&)>& prepare) {
#if PLIANT_HTTPLIB_MINOR >= 18
    std::string remote_address;
    std::string local_address;
    int remote_port = 0;
    int local_port = 0;
    stream.get_remote_ip_and_port(remote_address, remote_port);
    stream.get_local_ip_and_port(local_address, local_port);
    return process_request(stream, remote_address, remote_port, local_address, local_port, last,
                           client_closes, prepare);
#else
    return process_request(stream, last, client_closes, prepare);
#endif
  }

 private:
  bool process_and_close_socket(socket_t socket_fd) final {
    TakeSocket(socket_fd);
    return true;
  }
};

}  // namespace pliant::server
