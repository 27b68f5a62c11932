// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_server.h"

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <future>
#include <mutex>
#include <set>
#include <utility>

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include "descriptor/base/error.h"
#include "index/files/durable_file.h"
#include "server/http/connection.h"

namespace pliant::server {

namespace {

constexpr int kListenBacklog = 512;
constexpr std::chrono::milliseconds kFilesPause{10};

// Listens on the first of the host's addresses that this machine has. Without SO_REUSEPORT: two
// servers on one port must not go unnoticed. Connections inherit TCP_NODELAY.
FileHandle Listen(const std::string& host, const std::string& port) {
  addrinfo hints{};
  hints.ai_flags = AI_PASSIVE;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), port.c_str(), &hints, &found) != 0) found = nullptr;
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, freeaddrinfo);
  for (const addrinfo* one = found; one != nullptr; one = one->ai_next) {
    FileHandle listener(socket(one->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const int yes = 1;
    const int no = 0;
    setsockopt(listener.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    setsockopt(listener.get(), IPPROTO_IPV6, IPV6_V6ONLY, &no, sizeof(no));
    setsockopt(listener.get(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
    if (bind(listener.get(), one->ai_addr, one->ai_addrlen) == 0 &&
        listen(listener.get(), kListenBacklog) == 0) {
      return listener;
    }
  }
  throw Error(ErrorCode::kUnavailable, "address_in_use",
              "cannot listen on " + host + ":" + port +
                  ": the port is in use, or this machine does not have the address");
}

int PortOf(const FileHandle& listener) {
  sockaddr_in6 address{};  // the port of an IPv4 address has the same place
  socklen_t size = sizeof(address);
  getsockname(listener.get(), reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.sin6_port);
}

}  // namespace

// Accepts connections on the loop's thread.
class HttpServer::Impl {
 public:
  Impl(const Router& router, HttpOptions options, AdmitRequest admit,
       std::function<void(const RequestRecord&)> on_request)
      : listener_(Listen(options.host, std::to_string(options.port))),
        port_(PortOf(listener_)),
        context_{.sessions = {.options = std::move(options),
                              .router = router,
                              .admit = std::move(admit),
                              .on_request = std::move(on_request)},
                 .on_close = [this](const auto& connection) { OnClose(connection); }} {
    if (!options_.tls_certificate.empty()) {
      tls_ = std::make_unique<TlsContext>(options_.tls_certificate, options_.tls_key);
    }
  }

  ~Impl() { Drain(std::chrono::milliseconds(0)); }

  void Start() {
    context_.loop.Post([this] {
      context_.loop.Add(listener_.get(), [this](bool) { Accept(); });
      Accept();
    });
  }

  std::size_t Drain(std::chrono::milliseconds deadline) {
    context_.sessions.stopping = true;
    context_.loop.Post([this] {
      context_.loop.Remove(listener_.get());
      listener_.Close();
    });
    ForEach([](Connection& connection) { connection.Drain(); });
    std::unique_lock lock(mutex_);
    closed_one_.wait_for(lock, deadline, [&] { return connections_.empty(); });
    const std::size_t cut_off = connections_.size();
    lock.unlock();
    ForEach([](Connection& connection) { connection.Close(); });
    for (Workers* workers : {&context_.requests, &context_.health, &context_.handshakes}) {
      workers->Finish();
    }
    return cut_off;
  }

  void SetReady(bool ready) { context_.sessions.ready = ready; }
  int port() const { return port_; }

 private:
  void Accept() {
    int fd = 0;
    while ((fd = accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC)) >= 0) {
      Begin(std::make_shared<Connection>(context_, fd, tls_.get()));
    }
    // Without a file for it, the next connection stays in the queue.
    if (IsOutOfFiles(errno)) {
      return context_.loop.SetDeadline(listener_.get(), Clock::now() + kFilesPause);
    }
    context_.loop.Await(listener_.get(), EPOLLIN);
  }

  void Begin(const std::shared_ptr<Connection>& connection) {
    const auto of_address = [&] {
      return std::count_if(connections_.begin(), connections_.end(), [&](const auto& other) {
        return other->address() == connection->address();
      });
    };
    const int most = options_.connections_per_address;
    if (connections_.size() >= static_cast<std::size_t>(options_.max_connections) ||
        (most > 0 && of_address() >= most)) {
      return connection->TurnAway();
    }
    {
      const std::lock_guard lock(mutex_);
      connections_.insert(connection);
    }
    connection->Start();
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
  FileHandle listener_;
  const int port_;

  std::mutex mutex_;  // guards changes of connections_ by the loop's thread
  std::condition_variable closed_one_;
  std::set<std::shared_ptr<Connection>> connections_;

  ConnectionContext context_;
  const HttpOptions& options_ = context_.sessions.options;
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
