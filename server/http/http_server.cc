// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_server.h"

#include <algorithm>
#include <condition_variable>
#include <future>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include <httplib.h>
#include <sys/socket.h>

#include "descriptor/base/error.h"
#include "server/http/connection.h"

namespace pliant::server {

namespace {

constexpr int kListenBacklog = 512;

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

}  // namespace

// The library listens and accepts. process_and_close_socket() is private there:
// server/CMakeLists.txt refuses versions with which that was not tried.
class HttpServer::Impl final : public httplib::Server {
 public:
  Impl(const Router& router, HttpOptions options)
      : context_{.sessions = {.options = std::move(options), .router = router},
                 .on_close = [this](const auto& connection) { OnClose(connection); },
                 .has_room = [this](const auto& connection) { return HasRoom(connection); }} {
    if (!options_.tls_certificate.empty()) {
      tls_ = std::make_unique<TlsContext>(options_.tls_certificate, options_.tls_key);
    }
    new_task_queue = [] { return new PassingQueue; };
    set_socket_options([this](socket_t listener) {
      // Without SO_REUSEPORT, which the library sets: two servers on one port must not go
      // unnoticed.
      const int yes = 1;
      setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
      listener_ = listener;  // of several addresses, the last tried is the one that is bound
    });
    set_tcp_nodelay(true);
    Bind();
  }

  ~Impl() override { Drain(std::chrono::milliseconds(0)); }

  void Start() {
    accepting_ = std::thread([this] { listen_after_bind(); });
    // The library's stop() is lost when it comes before the loop runs.
    while (!is_running()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  std::size_t Drain(std::chrono::milliseconds deadline) {
    context_.sessions.stopping = true;
    if (accepting_.joinable()) {
      stop();
      accepting_.join();
    }
    ForEach([](Connection& connection) { connection.Drain(); });
    std::unique_lock lock(mutex_);
    closed_one_.wait_for(lock, deadline, [&] { return connections_.empty(); });
    const std::size_t cut_off = connections_.size();
    lock.unlock();
    ForEach([](Connection& connection) { connection.Close(); });
    for (Workers* workers :
         {&context_.requests, &context_.health, &context_.peers, &context_.handshakes}) {
      workers->Finish();
    }
    return cut_off;
  }

  int port() const { return port_; }

 private:
  void Bind() {
    const int port = options_.port == 0
                         ? bind_to_any_port(options_.host)
                         : (bind_to_port(options_.host, options_.port) ? options_.port : -1);
    if (port <= 0) {
      throw Error(ErrorCode::kUnavailable, "address_in_use",
                  "cannot listen on " + options_.host + ":" + std::to_string(options_.port) +
                      ": the port is in use, or this machine does not have the address");
    }
    port_ = port;
    ::listen(listener_, kListenBacklog);  // the library's own backlog is 5
  }

  bool process_and_close_socket(socket_t socket_fd) override {
    const auto connection = std::make_shared<Connection>(context_, socket_fd, tls_.get());
    context_.loop.Post([this, connection] { Begin(connection); });
    return true;
  }

  void Begin(const std::shared_ptr<Connection>& connection) {
    if (connections_.size() >= static_cast<std::size_t>(options_.max_connections) ||
        !HasRoom(*connection)) {
      return connection->TurnAway();
    }
    {
      const std::lock_guard lock(mutex_);
      connections_.insert(connection);
    }
    connection->Start();
  }

  // A proxy's connections count for its clients.
  bool HasRoom(const Connection& connection) const {
    const int most = options_.connections_per_address;
    if (most == 0 || context_.sessions.proxies.Contain(connection.address())) return true;
    return std::count_if(connections_.begin(), connections_.end(), [&](const auto& other) {
             return other.get() != &connection && other->address() == connection.address();
           }) < most;
  }

  void OnClose(const std::shared_ptr<Connection>& connection) {
    const std::lock_guard lock(mutex_);
    connections_.erase(connection);
    closed_one_.notify_all();
  }

  // Runs the action on the loop's thread, and waits for it.
  void ForEach(const std::function<void(Connection&)>& action) {
    std::promise<void> done;
    context_.loop.Post([&] {
      const auto connections = connections_;  // a copy: closed connections leave the set
      for (const auto& connection : connections) action(*connection);
      done.set_value();
    });
    done.get_future().wait();
  }

  std::unique_ptr<TlsContext> tls_;
  int port_ = 0;
  socket_t listener_ = INVALID_SOCKET;  // owned by the library

  std::mutex mutex_;  // guards changes of connections_ by the loop's thread
  std::condition_variable closed_one_;
  std::set<std::shared_ptr<Connection>> connections_;

  ConnectionContext context_;
  const HttpOptions& options_ = context_.sessions.options;
  std::thread accepting_;
};

HttpServer::HttpServer(const Router& router, HttpOptions options)
    : impl_(std::make_unique<Impl>(router, std::move(options))) {}

HttpServer::~HttpServer() = default;

int HttpServer::port() const { return impl_->port(); }
void HttpServer::Start() { impl_->Start(); }
std::size_t HttpServer::Drain(std::chrono::milliseconds deadline) { return impl_->Drain(deadline); }

}  // namespace pliant::server
