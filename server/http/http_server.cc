// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_server.h"

#include <condition_variable>
#include <future>
#include <map>
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
// Threads of their own for those who ask whether the server lives, so that they are answered when
// all others are busy.
constexpr int kHealthThreads = 2;
constexpr int kHealthQueue = 64;
// One of so many connections can wait for an event; the others are for who wants an answer now.
constexpr int kWaitingShare = 2;
// Cores that TLS handshakes can take from everything else.
constexpr int kHandshakeThreads = 1;

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

// Without SO_REUSEPORT, which the library sets: two servers on one port must not go unnoticed.
void SetListenOptions(socket_t listener) {
  const int yes = 1;
  setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
}

}  // namespace

// The library listens and accepts. process_and_close_socket() is private there:
// server/CMakeLists.txt refuses versions with which that was not tried.
class HttpServer::Impl final : public httplib::Server {
 public:
  Impl(const Router& router, HttpOptions options, AdmitRequest admit,
       std::function<void(const RequestRecord&)> on_request)
      : options_(std::move(options)),
        sessions_{router,
                  std::move(admit),
                  std::move(on_request),
                  OriginPolicy(options_.allowed_origins),
                  AllowedHosts(options_.host, options_.allowed_hosts),
                  !options_.tls_certificate.empty(),
                  options_.limits.max_body_bytes,
                  std::chrono::ceil<std::chrono::seconds>(options_.limits.idle_timeout),
                  options_.max_connections / kWaitingShare},
        budget_{options_.max_inflight_bytes},
        requests_(options_.threads, options_.connection_queue),
        health_(kHealthThreads, kHealthQueue),
        handshakes_(kHandshakeThreads, options_.max_connections) {
    if (!options_.tls_certificate.empty()) {
      tls_ = std::make_unique<TlsContext>(options_.tls_certificate, options_.tls_key);
    }
    new_task_queue = [] { return new PassingQueue; };
    set_socket_options([this](socket_t listener) {
      SetListenOptions(listener);
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
    sessions_.stopping = true;
    if (accepting_.joinable()) {
      stop();
      accepting_.join();
    }
    ForEach([](Connection& connection) { connection.Drain(); });
    std::unique_lock lock(mutex_);
    closed_one_.wait_for(lock, deadline, [&] { return open_ == 0; });
    const std::size_t cut_off = open_;
    lock.unlock();
    ForEach([](Connection& connection) { connection.Close(); });
    requests_.Finish();
    health_.Finish();
    handshakes_.Finish();
    return cut_off;
  }

  void SetReady(bool ready) { sessions_.ready = ready; }
  int port() const { return port_; }

 private:
  void Bind() {
    const int port = options_.port == 0
                         ? bind_to_any_port(options_.host)
                         : (bind_to_port(options_.host, options_.port) ? options_.port : -1);
    if (port <= 0) {
      throw Error(ErrorCode::kUnavailable, "address_in_use",
                  "cannot listen on " + options_.host + ":" + std::to_string(options_.port) +
                      ": the port is taken, or the address is none of this machine's");
    }
    port_ = port;
    ::listen(listener_, kListenBacklog);  // the library's own backlog is 5
  }

  bool process_and_close_socket(socket_t socket_fd) override {
    const auto connection = std::make_shared<Connection>(context_, socket_fd, tls_.get());
    loop_.Post([this, connection] { Welcome(connection); });
    return true;
  }

  void Welcome(const std::shared_ptr<Connection>& connection) {
    const auto of_address = by_address_.find(connection->address());
    const std::size_t same = of_address == by_address_.end() ? 0 : of_address->second;
    const auto most_of_address = static_cast<std::size_t>(options_.connections_per_address);
    if (connections_.size() >= static_cast<std::size_t>(options_.max_connections) ||
        (most_of_address > 0 && same >= most_of_address)) {
      connection->TurnAway(
          ProblemError("busy", "Too many connections. Try again shortly.").RetryAfter(2).problem());
      return;
    }
    connections_.insert(connection);
    ++by_address_[connection->address()];
    Count();
    connection->Start();
  }

  void OnClose(const std::shared_ptr<Connection>& connection) {
    const auto of_address = by_address_.find(connection->address());
    if (--of_address->second == 0) by_address_.erase(of_address);
    connections_.erase(connection);
    Count();
  }

  void Count() {
    const std::lock_guard lock(mutex_);
    open_ = connections_.size();
    closed_one_.notify_all();
  }

  // Does it on the loop's thread, and waits for that.
  void ForEach(const std::function<void(Connection&)>& action) {
    std::promise<void> done;
    loop_.Post([&] {
      const auto connections = connections_;  // a copy: those that close leave
      for (const auto& connection : connections) action(*connection);
      done.set_value();
    });
    done.get_future().wait();
  }

  const HttpOptions options_;
  std::unique_ptr<TlsContext> tls_;
  SessionContext sessions_;
  MemoryBudget budget_;
  int port_ = 0;
  socket_t listener_ = INVALID_SOCKET;  // owned by the library

  // Of the loop's thread.
  std::set<std::shared_ptr<Connection>> connections_;
  std::map<std::string, std::size_t> by_address_;

  std::mutex mutex_;  // guards open_
  std::condition_variable closed_one_;
  std::size_t open_ = 0;  // connections

  EventLoop loop_;  // outlives the workers, which post to it
  Workers requests_;
  Workers health_;
  Workers handshakes_;
  ConnectionContext context_{
      options_.limits, loop_,
      requests_,       health_,
      handshakes_,     sessions_,
      budget_,         [this](const auto& connection) { OnClose(connection); }};
  std::thread accepting_;
};

HttpServer::HttpServer(const Router& router, HttpOptions options, AdmitRequest admit,
                       std::function<void(const RequestRecord&)> on_request)
    : impl_(std::make_unique<Impl>(router, std::move(options), std::move(admit),
                                   std::move(on_request))) {}

HttpServer::~HttpServer() = default;

int HttpServer::port() const { return impl_->port(); }
void HttpServer::Start() { impl_->Start(); }
void HttpServer::SetReady(bool ready) { impl_->SetReady(ready); }
std::size_t HttpServer::Drain(std::chrono::milliseconds deadline) { return impl_->Drain(deadline); }

}  // namespace pliant::server
