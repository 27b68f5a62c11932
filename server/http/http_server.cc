// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_server.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include <httplib.h>
#include <sys/socket.h>

#include "descriptor/base/error.h"
#include "server/http/exchange.h"
#include "server/http/library.h"
#include "server/http/library_handlers.h"
#include "server/http/reception.h"
#include "server/http/visit_queue.h"

namespace pliant::server {

namespace {

constexpr std::size_t kMaxRequestsPerConnection = 1000;
constexpr int kListenBacklog = 512;
// Threads of their own for those who ask whether the server lives, so that they are answered when
// all others are busy.
constexpr int kHealthThreads = 2;
constexpr int kHealthQueue = 64;
// One of so many connections may wait for an event; the others are for who wants an answer now.
constexpr int kWaitingShare = 2;
// Cores that TLS greetings may take from everything else.
constexpr int kGreetingThreads = 1;

// Without SO_REUSEPORT, which the library sets: two servers on one port must not go unnoticed.
void SetListenOptions(socket_t listener) {
  const int yes = 1;
  setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
}

bool AsksForHealth(const RequestHead& head) {
  constexpr std::array<std::string_view, 3> kPaths = {"/livez", "/readyz", "/metrics"};
  const std::string_view path = std::string_view(head.target).substr(0, head.target.find('?'));
  return head.framing == BodyFraming::kNone &&
         std::find(kPaths.begin(), kPaths.end(), path) != kPaths.end();
}

}  // namespace

class HttpServer::Impl final : public LibraryServer, private Reception::Host {
 public:
  Impl(const Router& router, HttpOptions options, AdmitRequest admit,
       std::function<void(const RequestRecord&)> on_request)
      : options_(std::move(options)),
        on_request_(std::move(on_request)),
        shared_{router,
                std::move(admit),
                OriginPolicy(options_.allowed_origins),
                AllowedHosts(options_.host, options_.allowed_hosts),
                !options_.tls_certificate.empty(),
                options_.limits.max_body_bytes,
                options_.max_connections / kWaitingShare},
        budget_{options_.max_inflight_bytes},
        reception_({options_.limits, static_cast<std::size_t>(options_.max_connections),
                    static_cast<std::size_t>(options_.connections_per_address)},
                   this),
        requests_(std::make_unique<VisitQueue>(options_.threads, options_.connection_queue,
                                               [this](auto visit) { Serve(std::move(visit)); })),
        health_(std::make_unique<VisitQueue>(kHealthThreads, kHealthQueue,
                                             [this](auto visit) { Serve(std::move(visit)); })),
        greetings_(std::make_unique<VisitQueue>(kGreetingThreads, options_.max_connections,
                                                [this](auto visit) { Greet(std::move(visit)); })) {
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
    SetLibraryHandlers(*this);
    Bind();
  }

  ~Impl() override { Finish(std::chrono::milliseconds(0)); }

  void Start() {
    accepting_ = std::thread([this] { listen_after_bind(); });
    // The library's stop() is lost when it comes before the loop runs.
    while (!is_running()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  std::size_t Finish(std::chrono::milliseconds deadline) {
    if (!requests_) return 0;
    shared_.stopping = true;
    if (accepting_.joinable()) {
      stop();
      accepting_.join();
    }
    const std::size_t cut_off = reception_.Stop(deadline);
    requests_.reset();  // their threads end
    health_.reset();
    greetings_.reset();
    return cut_off;
  }

  void SetReady(bool ready) { shared_.ready = ready; }
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

  void TakeSocket(socket_t socket_fd) override {
    std::unique_ptr<TlsSession> tls;
    if (tls_) tls = std::make_unique<TlsSession>(*tls_, socket_fd);
    reception_.Admit(
        std::make_unique<Connection>(socket_fd, options_.limits, &budget_, std::move(tls)));
  }

  void OnArrival(std::unique_ptr<Visit> visit) override {
    VisitQueue& queue = AsksForHealth(visit->connection->head()) ? *health_ : *requests_;
    if (queue.Offer(visit, visit->exchange && visit->exchange->waits())) return;
    visit->connection->SetFault(Connection::Fault::kBusy);
    OnFault(*visit);
    visit->exchange.reset();
    reception_.Return(std::move(visit), Next::kLinger);
  }

  void OnGreeting(std::unique_ptr<Visit> visit) override {
    if (greetings_->Offer(visit)) return;
    visit->greeting = Connection::Step::kOver;
    reception_.Return(std::move(visit), Next::kGreet);
  }

  void Greet(std::unique_ptr<Visit> visit) {
    visit->greeting = visit->connection->Greet();
    reception_.Return(std::move(visit), Next::kGreet);
  }

  void OnFault(Visit& visit) override {
    visit.connection->Rewind();  // its answer counts again
    if (!visit.exchange) {
      visit.exchange = std::make_unique<Exchange>(shared_, *visit.connection);
    }
    AnswerByHand(visit, visit.exchange->FaultProblem());
  }

  void OnCrowd(Visit& visit) override {
    visit.begun = Clock::now();
    visit.exchange = std::make_unique<Exchange>(shared_, *visit.connection);
    AnswerByHand(
        visit,
        ProblemError("busy", "Too many connections. Try again shortly.").RetryAfter(2).problem());
  }

  void Serve(std::unique_ptr<Visit> visit) {
    Next next = ServeOne(*visit);
    if (next != Next::kBody && next != Next::kEvent) {
      visit->exchange.reset();
      visit->connection->ForgetRequest();
      ++visit->served;
      // Closing with unread bytes would reset the connection, and with it the answer.
      if (next == Next::kEnd && visit->connection->has_bytes()) next = Next::kLinger;
    }
    reception_.Return(std::move(visit), next);
  }

  Next ServeOne(Visit& visit) {
    Connection& connection = *visit.connection;
    if (!visit.exchange) visit.exchange = std::make_unique<Exchange>(shared_, connection);
    Exchange& exchange = *visit.exchange;
    const bool last = visit.served + 1 >= kMaxRequestsPerConnection || shared_.stopping;
    bool client_closes = false;
    connection.Rewind();
    const ServingExchange serving(exchange);
    const bool written =
        ProcessRequest(connection, last, client_closes, [&](httplib::Request& request) {
          exchange.NoteAcceptedCodings(PrepareForLibrary(request));
          if (connection.body_received()) request.headers.erase("Expect");  // was answered
        });
    if (exchange.awaits_body()) return Next::kBody;
    if (exchange.waits()) return Next::kEvent;
    if (exchange.answered()) {
      const std::chrono::duration<double> seconds = Clock::now() - visit.begun;
      on_request_(exchange.Record(seconds.count()));
    }
    if (exchange.must_close()) return Next::kLinger;
    return written && !last && !client_closes ? Next::kRequest : Next::kEnd;
  }

  void AnswerByHand(const Visit& visit, const Problem& problem) {
    const Exchange& exchange = *visit.exchange;
    const Response response = ProblemResponse(problem, exchange.request_id());
    std::string text = "HTTP/1.1 " + std::to_string(problem.status) + " " +
                       StatusTitle(problem.status) +
                       "\r\nConnection: close\r\nContent-Type: " + response.content_type +
                       "\r\nX-Request-Id: " + exchange.request_id() +
                       "\r\nContent-Length: " + std::to_string(response.body.size()) + "\r\n";
    for (const auto& [name, value] : response.headers) text += name + ": " + value + "\r\n";
    text += "\r\n" + response.body;
    visit.connection->write(text.data(), text.size());
    const std::chrono::duration<double> seconds = Clock::now() - visit.begun;
    RequestRecord record = exchange.Record(seconds.count());
    record.status = problem.status;
    record.code = problem.code;
    record.bytes_out = response.body.size();
    on_request_(record);
  }

  HttpOptions options_;
  std::unique_ptr<TlsContext> tls_;
  std::function<void(const RequestRecord&)> on_request_;
  ExchangeShared shared_;
  MemoryBudget budget_;
  int port_ = 0;
  socket_t listener_ = INVALID_SOCKET;  // owned by the library
  Reception reception_;                 // outlives the threads that return visits to it
  std::unique_ptr<VisitQueue> requests_;
  std::unique_ptr<VisitQueue> health_;
  std::unique_ptr<VisitQueue> greetings_;
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
std::size_t HttpServer::Stop(std::chrono::milliseconds deadline) { return impl_->Finish(deadline); }

}  // namespace pliant::server
