// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_server.h"

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <set>
#include <utility>

#include <httplib.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "server/http/connection_queue.h"
#include "server/http/exchange.h"
#include "server/http/library.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMaxRequestsPerConnection = 1000;
constexpr const char* kAnyPath = R"([\s\S]*)";
constexpr int kListenBacklog = 512;
// An idle connection gives its thread up this soon when others wait for one.
constexpr std::chrono::milliseconds kIdleWhenCrowded{50};

// The library calls its handlers without saying for which connection. One thread serves one
// connection at a time, so this is that thread's exchange.
thread_local Exchange* current_exchange = nullptr;

// Without SO_REUSEPORT, which the library sets: two servers on one port must not go unnoticed.
void SetListenOptions(socket_t listener) {
  const int yes = 1;
  setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
}

}  // namespace

class HttpServer::Impl final : public LibraryServer {
 public:
  Impl(const Router& router, HttpOptions options, AdmitRequest admit,
       std::function<void(const RequestRecord&)> on_request)
      : options_(std::move(options)),
        on_request_(std::move(on_request)),
        shared_{router,
                std::move(admit),
                options_.allowed_origins,
                AllowedHosts(options_.host, options_.allowed_hosts),
                !options_.tls_certificate.empty(),
                options_.limits.max_body_bytes,
                options_.max_inflight_bytes},
        wake_fd_(eventfd(0, EFD_CLOEXEC)) {
    new_task_queue = [this] {
      return new ConnectionQueue(options_.threads, options_.connection_queue, waiting_);
    };
    set_socket_options([this](socket_t listener) {
      SetListenOptions(listener);
      listener_ = listener;  // of several addresses, the last tried is the one that is bound
    });
    set_tcp_nodelay(true);
    set_keep_alive_timeout(
        std::chrono::ceil<std::chrono::seconds>(options_.limits.idle_timeout).count());
    set_keep_alive_max_count(kMaxRequestsPerConnection);
    set_payload_max_length(options_.limits.max_body_bytes);
    if (!options_.tls_certificate.empty()) {
      tls_ = std::make_unique<TlsContext>(options_.tls_certificate, options_.tls_key);
    }
    SetHandlers();
    Bind();
  }

  ~Impl() override {
    Finish(std::chrono::milliseconds(0));
    close(wake_fd_);
  }

  void Start() {
    accepting_ = std::thread([this] {
      listen_after_bind();
      const std::lock_guard lock(mutex_);
      finished_ = true;
      changed_.notify_all();
    });
    // The library's stop() is lost when it comes before the loop runs.
    while (!is_running()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  std::size_t Finish(std::chrono::milliseconds deadline) {
    if (!accepting_.joinable()) return 0;
    shared_.stopping = true;
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t woken = ::write(wake_fd_, &one, sizeof(one));
    stop();
    std::size_t cut_off = 0;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait_for(lock, deadline, [&] { return finished_; })) {
        cut_off = open_sockets_.size();
        for (const int fd : open_sockets_) shutdown(fd, SHUT_RDWR);
      }
    }
    accepting_.join();
    return cut_off;
  }

  void SetReady(bool ready) { shared_.ready = ready; }
  int port() const { return port_; }

 private:
  void SetHandlers() {
    set_pre_routing_handler([](const httplib::Request& request, httplib::Response& answer) {
      return current_exchange->BeforeBody(request, answer) ? HandlerResponse::Handled
                                                           : HandlerResponse::Unhandled;
    });
    const auto with_body = [](const httplib::Request&, httplib::Response& answer,
                              const httplib::ContentReader& reader) {
      current_exchange->WithBody(reader, answer);
    };
    Post(kAnyPath, with_body);
    Put(kAnyPath, with_body);
    Delete(kAnyPath, with_body);
    set_expect_100_continue_handler([](const httplib::Request& request, httplib::Response& answer) {
      return current_exchange->BeforeBody(request, answer) ? answer.status : 100;
    });
    // Must be of the kind that returns nothing: the library then sets Content-Length.
    set_error_handler([](const httplib::Request& request, httplib::Response& answer) {
      current_exchange->OnLibraryError(request, answer);
    });
    set_exception_handler(
        [](const httplib::Request&, httplib::Response& answer, std::exception_ptr error) {
          try {
            std::rethrow_exception(error);
          } catch (...) {
            current_exchange->OnException(answer);
          }
        });
    set_post_routing_handler([](const httplib::Request&, httplib::Response& answer) {
      // RFC 9110, section 8.6: these have no content, so they have no length either.
      if (answer.status == 204 || answer.status == 304) answer.headers.erase("Content-Length");
      // The library promises both without asking.
      answer.headers.erase("Accept-Ranges");
      if (answer.get_header_value("Connection") == "close") answer.headers.erase("Keep-Alive");
    });
    set_logger([](const httplib::Request&, const httplib::Response& answer) {
      current_exchange->NoteAnswer(answer);
    });
  }

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

  void ServeSocket(socket_t socket_fd) override {
    std::unique_ptr<TlsSession> tls;
    if (tls_) tls = std::make_unique<TlsSession>(*tls_, socket_fd);
    Connection connection(socket_fd, wake_fd_, options_.limits, std::move(tls));
    if (ConnectionQueue::Rejecting()) {
      Reject(connection);
    } else {
      Track(socket_fd, true);
      if (connection.Handshake()) Serve(connection);
      Track(socket_fd, false);
    }
  }

  void Serve(Connection& connection) {
    for (std::size_t served = 1; served <= kMaxRequestsPerConnection; ++served) {
      const bool crowded = waiting_ > 0 && served > 1;
      if (!connection.AwaitRequest(crowded ? kIdleWhenCrowded : options_.limits.idle_timeout)) {
        return;
      }
      const bool last = served == kMaxRequestsPerConnection || shared_.stopping || waiting_ > 0;
      if (!ServeOne(connection, last)) return;
    }
  }

  // True when the connection can carry another request.
  bool ServeOne(Connection& connection, bool last) {
    const Clock::time_point start = Clock::now();
    Exchange exchange(shared_, connection);
    current_exchange = &exchange;
    connection.BeginHeaders();
    bool client_closes = false;
    const bool written =
        ProcessRequest(connection, last, client_closes, [&](httplib::Request& request) {
          connection.BeginBody();
          // Answers are whole and plain: ranges and on-the-fly compression cost more than they
          // give for pictures and short JSON.
          request.ranges.clear();
          request.headers.erase("Accept-Encoding");
        });
    current_exchange = nullptr;
    if (!exchange.answered() && AnswerBrokenRequestLine(exchange, connection)) return false;
    if (exchange.answered()) {
      const std::chrono::duration<double> seconds = Clock::now() - start;
      on_request_(exchange.Record(seconds.count()));
    }
    const bool goes_on = written && !last && !client_closes && !exchange.must_close();
    if (exchange.must_close()) {
      connection.LingeringClose();
    } else if (!goes_on && (written || connection.fault() == Connection::Fault::kClosed)) {
      connection.Farewell();
    }
    return goes_on;
  }

  void Reject(Connection& connection) {
    const Exchange exchange(shared_, connection);
    // Under TLS there is no answer without a greeting first, and this thread must not wait for one.
    AnswerByHand(exchange, connection,
                 ProblemError("busy", "Too many connections. Try again shortly.").problem());
    shutdown(connection.socket(), SHUT_WR);
  }

  // The library gives no answer to a request line that is too long or never ends.
  bool AnswerBrokenRequestLine(const Exchange& exchange, Connection& connection) {
    const bool too_large = connection.fault() == Connection::Fault::kHeadersTooLarge;
    const bool too_slow =
        connection.fault() == Connection::Fault::kTimeout && connection.header_bytes() > 0;
    if (!too_large && !too_slow) return false;
    AnswerByHand(exchange, connection, ProblemForStatus(too_large ? 431 : 408));
    connection.LingeringClose();
    return true;
  }

  // One send that does not wait: this may be the accepting thread.
  void AnswerByHand(const Exchange& exchange, Connection& connection, const Problem& problem) {
    const Response response = ProblemResponse(problem, exchange.request_id());
    std::string text = "HTTP/1.1 " + std::to_string(problem.status) + " " +
                       StatusTitle(problem.status) +
                       "\r\nConnection: close\r\nContent-Type: " + response.content_type +
                       "\r\nX-Request-Id: " + exchange.request_id() +
                       "\r\nContent-Length: " + std::to_string(response.body.size()) + "\r\n";
    for (const auto& [name, value] : response.headers) text += name + ": " + value + "\r\n";
    text += "\r\n" + response.body;
    connection.SendNow(text);
    RequestRecord record = exchange.Record(0);
    record.status = problem.status;
    record.code = problem.code;
    on_request_(record);
  }

  void Track(int socket_fd, bool open) {
    const std::lock_guard lock(mutex_);
    if (open) {
      open_sockets_.insert(socket_fd);
    } else {
      open_sockets_.erase(socket_fd);
    }
  }

  HttpOptions options_;
  std::unique_ptr<TlsContext> tls_;
  std::function<void(const RequestRecord&)> on_request_;
  ExchangeShared shared_;
  int wake_fd_;
  int port_ = 0;
  socket_t listener_ = INVALID_SOCKET;  // owned by the library
  std::atomic<int> waiting_{0};
  std::thread accepting_;
  std::mutex mutex_;  // guards finished_ and open_sockets_
  std::condition_variable changed_;
  bool finished_ = false;
  std::set<int> open_sockets_;
};

HttpServer::HttpServer(const Router& router, HttpOptions options, AdmitRequest admit,
                       std::function<void(const RequestRecord&)> on_request)
    : impl_(std::make_unique<Impl>(router, std::move(options), std::move(admit),
                                   std::move(on_request))) {}

HttpServer::~HttpServer() = default;

int HttpServer::port() const { return impl_->port(); }
void HttpServer::Start() { impl_->Start(); }
void HttpServer::SetReady(bool ready) { impl_->SetReady(ready); }
std::size_t HttpServer::Stop(std::chrono::milliseconds deadline) { return impl_->Finish(deadline); }

}  // namespace pliant::server
