// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/connection.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <stdexcept>
#include <utility>

#include <fcntl.h>
#include <netdb.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/http/body_file.h"

namespace pliant::server {

namespace {

constexpr std::size_t kReceiveBytes = 64 * 1024;
constexpr std::size_t kFilePieceBytes = 64 * 1024;   // in memory for one client
constexpr std::size_t kMostAtOnce = 1024 * 1024;     // then other clients have their turn
constexpr std::size_t kAlwaysKeptBytes = 16 * 1024;  // of an answer: enough to say what is wrong
constexpr std::size_t kMostDroppedBytes = 4 * 1024 * 1024;
constexpr std::chrono::milliseconds kLingerTime{1'000};
constexpr const char* kContinue = "HTTP/1.1 100 Continue\r\n\r\n";

// The time that a long answer or body can take beside the time for any.
std::chrono::seconds TimeFor(std::uint64_t bytes) {
  constexpr std::uint64_t kSlowest = 32 * 1024;  // bytes a second
  constexpr std::uint64_t kMostSeconds = 30 * 24 * 3600;
  return std::chrono::seconds(std::min(bytes / kSlowest, kMostSeconds));
}

std::string PeerOf(int socket_fd) {
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  std::array<char, NI_MAXHOST> host{};
  const bool known = getpeername(socket_fd, reinterpret_cast<sockaddr*>(&address), &length) == 0 &&
                     getnameinfo(reinterpret_cast<const sockaddr*>(&address), length, host.data(),
                                 host.size(), nullptr, 0, NI_NUMERICHOST) == 0;
  return known ? host.data() : "";
}

// Of a call on a socket, as TlsSession gives it.
template <typename Call>
ssize_t ResultOf(Call call) {
  ssize_t result = 0;
  do {
    result = call();
  } while (result < 0 && errno == EINTR);
  const bool waits = result < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
  return waits ? TlsSession::kWait : result;
}

}  // namespace

Connection::Connection(ConnectionContext& context, int socket_fd, const TlsContext* tls)
    : context_(context),
      socket_fd_(socket_fd),
      tls_(tls == nullptr ? nullptr : std::make_unique<TlsSession>(*tls, socket_fd)),
      address_(PeerOf(socket_fd)),
      awaited_(EPOLLIN),
      reader_(context.limits.max_header_bytes, context.limits.max_body_bytes, &context.budget) {
  fcntl(socket_fd, F_SETFL, fcntl(socket_fd, F_GETFL) | O_NONBLOCK);
}

Connection::~Connection() {
  tls_.reset();
  close(socket_fd_);
}

void Connection::Start() {
  context_.loop.Add(socket_fd_, [self = shared_from_this()](EventLoop::Event event) {
    self->Run(
        [&] { return event == EventLoop::Event::kTimeout ? self->OnTimeout() : self->Step(); });
  });
  Enter(tls_ ? Phase::kHandshake : Phase::kIdle);
  Run([this] { return tls_ ? Await() : Step(); });
}

// Takes steps until one must wait. What fails (no memory) fails for this client, not for all.
void Connection::Run(const std::function<bool()>& step) {
  try {
    bool goes_on = phase_ != Phase::kClosed && step();
    while (goes_on) goes_on = Step();
  } catch (const std::exception&) {
    Close();
  }
}

bool Connection::Step() {
  switch (phase_) {
    case Phase::kHandshake:
      return Handshake();
    case Phase::kIdle:
    case Phase::kHead:
      return ReceiveHead();
    case Phase::kBody:
      return ReceiveBody();
    case Phase::kWaiting:  // the client has ended its side, or the connection broke
      return Serve();
    case Phase::kSending:
      return Send();
    case Phase::kLingering:
      return Linger();
    case Phase::kServing:
    case Phase::kClosed:
      break;
  }
  return false;
}

void Connection::Enter(Phase phase) {
  const ConnectionLimits& limits = context_.limits;
  const Clock::time_point now = Clock::now();
  phase_ = phase;
  switch (phase) {
    case Phase::kHandshake:
    case Phase::kHead:
      return SetDeadline(now + limits.header_timeout);
    case Phase::kIdle:
      return SetDeadline(now + limits.idle_timeout);
    case Phase::kBody:
      last_deadline_ = now + limits.body_timeout + TimeFor(reader_.body_left());
      return SetDeadline(now + limits.body_timeout);
    case Phase::kWaiting:
      return SetDeadline(session_->wait().until);
    case Phase::kSending:
      last_deadline_ = now + limits.answer_timeout + TimeFor(rest_.file ? rest_.file->size() : 0);
      return SetDeadline(now + limits.write_timeout);
    case Phase::kLingering:
      return SetDeadline(now + kLingerTime);
    case Phase::kServing:
    case Phase::kClosed:
      return SetDeadline(EventLoop::kNever);
  }
}

void Connection::SetDeadline(Clock::time_point deadline) {
  context_.loop.SetDeadline(socket_fd_, deadline);
}

bool Connection::Await() {
  context_.loop.Await(socket_fd_, awaited_);
  return false;
}

bool Connection::OnTimeout() {
  if (phase_ == Phase::kWaiting) return Serve();
  if (phase_ == Phase::kHead || phase_ == Phase::kBody) {
    return Refuse(ProblemError("request_timeout", "The request did not arrive in time.").problem());
  }
  Close();  // nobody to tell, or nothing to say
  return false;
}

bool Connection::Handshake() {
  const bool taken = context_.handshakes.Run([self = shared_from_this()] {
    const ssize_t result = self->tls_->Handshake();
    self->context_.loop.Post(
        [self, result] { self->Run([&] { return self->OnHandshake(result); }); });
  });
  if (!taken) Close();
  return false;
}

bool Connection::OnHandshake(ssize_t result) {
  if (result == TlsSession::kWait) {
    awaited_ = tls_->wants_output() ? EPOLLOUT : EPOLLIN;
    return Await();
  }
  if (result <= 0) {
    Close();
    return false;
  }
  Enter(Phase::kIdle);
  return true;
}

bool Connection::Receive() {
  // Of the thread, so that a connection that waits has no buffer.
  thread_local std::array<char, kReceiveBytes> buffer;
  const ssize_t got =
      tls_ ? tls_->Read(buffer.data(), buffer.size())
           : ResultOf([&] { return recv(socket_fd_, buffer.data(), buffer.size(), 0); });
  if (got > 0) {
    reader_.Append({buffer.data(), static_cast<std::size_t>(got)});
    return true;
  }
  if (got == TlsSession::kWait) {
    awaited_ = tls_ && tls_->wants_output() ? EPOLLOUT : EPOLLIN;
    return Await();
  }
  if (tls_) tls_->Close();  // the client has ended it
  Close();
  return false;
}

bool Connection::ReceiveHead() {
  while (true) {
    const bool arrived = reader_.ReadHead();
    if (phase_ == Phase::kIdle && (arrived || reader_.has_bytes())) {
      begun_ = Clock::now();
      Enter(Phase::kHead);
    }
    if (arrived) break;
    if (!Receive()) return false;
  }
  session_ = std::make_shared<Session>(context_.sessions, reader_.TakeHead(), address_, begun_,
                                       served_ + 1 >= kMostRequestsPerConnection);
  if (reader_.refusal()) return Refuse(*reader_.refusal());
  if (!session_->takes_body_first()) return Serve();
  Enter(Phase::kBody);
  return true;
}

bool Connection::ReceiveBody() {
  const std::uint64_t before = reader_.body_bytes();
  while (!reader_.ReadBody()) {
    const std::uint64_t got = reader_.body_bytes() - before;
    // A long body that comes along gets more time, up to that for the whole; of one in chunks, up
    // to that for what has come.
    if (reader_.has_sink() && got > 0) {
      const auto earned = TimeFor(reader_.body_left() > 0 ? 0 : reader_.body_bytes());
      SetDeadline(std::min(last_deadline_ + earned, Clock::now() + context_.limits.body_timeout));
    }
    if (got >= kMostAtOnce) {
      awaited_ = EPOLLIN;
      return Await();
    }
    if (!Receive()) return false;
  }
  if (reader_.refusal()) return Refuse(*reader_.refusal());
  session_->TakeBody(reader_.TakeBody(), reader_.body_bytes());
  return Serve();
}

bool Connection::Serve() {
  const bool has_waited = phase_ == Phase::kWaiting;  // there is a limit on these elsewhere
  subscription_.reset();
  Enter(Phase::kServing);
  Workers& workers = session_->asks_for_health() ? context_.health : context_.requests;
  const bool taken = workers.Run(
      [self = shared_from_this(), session = session_] {
        session->Serve();
        self->context_.loop.Post([self] { self->Run([&] { return self->OnServed(); }); });
      },
      has_waited);
  if (taken) return false;
  return Refuse(ProblemError("busy", "Too many requests at the moment. Try again shortly.")
                    .RetryAfter(2)
                    .problem());
}

bool Connection::OnServed() {
  switch (session_->next()) {
    case Session::Next::kAnswer:
      return SendAnswer();
    case Session::Next::kEvent:
      return AwaitEvent();
    case Session::Next::kBody:
      break;
  }
  reader_.ReceiveInto(session_->sink());
  reader_.ReadBody();
  if (reader_.refusal()) return Refuse(*reader_.refusal());
  if (!session_->expects_continue()) {
    Enter(Phase::kBody);
    return true;
  }
  unsent_ = kContinue;
  after_ = AfterSending::kBody;
  Enter(Phase::kSending);
  return true;
}

bool Connection::AwaitEvent() {
  Enter(Phase::kWaiting);
  // What the client sends meanwhile is its next request: it has time.
  context_.loop.Await(socket_fd_, EPOLLRDHUP);
  const auto on_event = [weak = weak_from_this(), session = std::weak_ptr(session_)] {
    const auto self = weak.lock();
    if (!self || self->phase_ != Phase::kWaiting || self->session_ != session.lock()) return;
    self->Run([&] { return self->Serve(); });
  };
  subscription_ =
      session_->wait().subscribe([&loop = context_.loop, on_event] { loop.Post(on_event); });
  return false;
}

bool Connection::Refuse(const Problem& problem) {
  if (!session_) {
    session_ = std::make_shared<Session>(context_.sessions, RequestHead{}, address_, begun_, true);
  }
  session_->Refuse(problem, reader_.body_bytes());
  return SendAnswer();
}

void Connection::TurnAway(const Problem& problem) {
  if (!tls_) {
    Session session(context_.sessions, {}, address_, Clock::now(), true);
    session.Refuse(problem, 0);
    unsent_ = session.TakeAnswer().text;
    SendSome();
  }
  EndSending();
}

// The request is over, but for the client's taking of the answer.
bool Connection::SendAnswer() {
  rest_ = session_->TakeAnswer();
  unsent_ = std::move(rest_.text);
  file_sent_ = 0;
  after_ = rest_.keeps_open ? AfterSending::kRequest : AfterSending::kEnd;
  session_.reset();
  reader_.Forget();
  ++served_;
  Enter(Phase::kSending);
  return true;
}

bool Connection::Refill() {
  if (sent_ < unsent_.size()) return true;
  sent_ = 0;
  unsent_.clear();
  if (!rest_.body.empty()) {
    unsent_ = std::exchange(rest_.body, {});
    return true;
  }
  if (!rest_.file || file_sent_ == rest_.file->size()) return false;
  unsent_.resize(kFilePieceBytes);
  const std::ptrdiff_t got = rest_.file->Read(file_sent_, unsent_.data(), unsent_.size());
  if (got <= 0) throw std::runtime_error("a file ends before its end");  // more was promised
  unsent_.resize(static_cast<std::size_t>(got));
  file_sent_ += static_cast<std::uint64_t>(got);
  return true;
}

ssize_t Connection::SendSome() {
  const char* data = unsent_.data() + sent_;
  const std::size_t size = unsent_.size() - sent_;
  const ssize_t sent = tls_ ? tls_->Write(data, size)
                            : ResultOf([&] { return send(socket_fd_, data, size, MSG_NOSIGNAL); });
  awaited_ = tls_ && sent == TlsSession::kWait && !tls_->wants_output() ? EPOLLIN : EPOLLOUT;
  return sent;
}

bool Connection::Send() {
  std::size_t sent_now = 0;
  while (Refill()) {
    const ssize_t sent = sent_now < kMostAtOnce ? SendSome() : TlsSession::kWait;
    if (sent > 0) {
      sent_ += static_cast<std::size_t>(sent);
      sent_now += static_cast<std::size_t>(sent);
      continue;
    }
    const std::size_t unsent = unsent_.size() - sent_ + rest_.body.size();
    if (held_ == 0 && !rest_.file && context_.budget.Take(unsent)) held_ = unsent;
    // Without memory for it, waiting for this client would let all others wait.
    const bool kept = held_ > 0 || rest_.file || unsent <= kAlwaysKeptBytes;
    if (sent != TlsSession::kWait || !kept) {
      Close();
      return false;
    }
    if (sent_now > 0) {
      SetDeadline(std::min(last_deadline_, Clock::now() + context_.limits.write_timeout));
    }
    return Await();
  }
  unsent_ = {};
  rest_ = {};
  context_.budget.Give(std::exchange(held_, 0));
  if (after_ == AfterSending::kBody) {
    Enter(Phase::kBody);
  } else if (after_ == AfterSending::kRequest && !context_.sessions.stopping) {
    Enter(Phase::kIdle);
  } else {
    EndSending();
    Enter(Phase::kLingering);
  }
  return true;
}

// Says that no more comes; the client can still read what was sent. Under TLS that is close_notify
// (RFC 8446, 6.1; RFC 9112, 9.8), for connections that end with an answer which said so. Not for
// one that waits for a request: clients that only look whether there are bytes to read (cpp-httplib
// 0.11) take the alert for a living connection, send the next request and fail, while a bare end
// makes them connect again. Nothing can be cut off there: every answer was complete by its length.
void Connection::EndSending() {
  if (tls_) tls_->Close();
  shutdown(socket_fd_, SHUT_WR);
}

// Closing with unread bytes would reset the connection, and with it the answer (RFC 9112, 9.6).
bool Connection::Linger() {
  std::array<char, 16 * 1024> nothing;  // below TLS: nobody reads it
  ssize_t got = 1;
  while (got > 0 && dropped_ < kMostDroppedBytes) {
    got = ResultOf([&] { return recv(socket_fd_, nothing.data(), nothing.size(), 0); });
    if (got > 0) dropped_ += static_cast<std::size_t>(got);
  }
  awaited_ = EPOLLIN;
  if (got == TlsSession::kWait) return Await();
  Close();
  return false;
}

void Connection::Drain() {
  if (phase_ == Phase::kHandshake || phase_ == Phase::kIdle) Close();
  if (phase_ == Phase::kWaiting) Run([this] { return Serve(); });
}

void Connection::Close() {
  if (phase_ == Phase::kClosed) return;
  Enter(Phase::kClosed);
  context_.loop.Remove(socket_fd_);
  shutdown(socket_fd_, SHUT_RDWR);
  subscription_.reset();
  session_.reset();
  reader_.Forget();
  context_.budget.Give(std::exchange(held_, 0));
  context_.on_close(shared_from_this());
}

}  // namespace pliant::server
