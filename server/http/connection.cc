// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/connection.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include <sys/epoll.h>

#include "server/http/body_file.h"

namespace pliant::server {

namespace {

constexpr std::size_t kReceiveBytes = 64 * 1024;
constexpr std::size_t kFilePieceBytes = 64 * 1024;   // in memory for one client
constexpr std::size_t kMostAtOnce = 1024 * 1024;     // then other clients have their turn
constexpr std::size_t kAlwaysKeptBytes = 16 * 1024;  // of an answer: enough to say what is wrong
constexpr std::size_t kMostDroppedBytes = 4 * 1024 * 1024;
constexpr std::chrono::milliseconds kDiscardTime{1'000};
constexpr std::string_view kContinue = "HTTP/1.1 100 Continue\r\n\r\n";

// The time that a long answer or body can take beside the time for any.
std::chrono::seconds TimeFor(std::uint64_t bytes) {
  constexpr std::uint64_t kSlowest = 32 * 1024;  // bytes a second
  constexpr std::uint64_t kMostSeconds = 30 * 24 * 3600;
  return std::chrono::seconds(std::min(bytes / kSlowest, kMostSeconds));
}

}  // namespace

bool Workers::Run(std::function<void()> task, bool past_limit) {
  if (++waiting_ > limit_ && !past_limit) {
    --waiting_;
    return false;
  }
  pool_.enqueue([this, task = std::move(task)] {
    --waiting_;
    task();
  });
  return true;
}

Connection::Connection(ConnectionContext& context, int socket_fd, const TlsContext* tls)
    : context_(context),
      options_(context.sessions.options),
      socket_(socket_fd, tls),
      peer_(socket_.PeerAddress()),
      address_(peer_),
      reader_(options_.max_header_bytes, options_.max_body_bytes, &context.budget) {}

void Connection::Start() {
  context_.loop.Add(socket_.fd(), [self = shared_from_this()](bool timed_out) {
    self->Run([&] { return timed_out ? self->OnTimeout() : self->Step(); });
  });
  Enter(socket_.encrypted() ? Phase::kHandshake : Phase::kIdle);
  Run([this] { return Await(); });
}

// Takes steps until one must wait. A refused request is answered. What else fails (no memory) fails
// for this client, not for all.
void Connection::Run(const std::function<bool()>& first) {
  const auto take = [this](const std::function<bool()>& step) {
    try {
      return step();
    } catch (const ProblemError& refusal) {
      return Refuse(refusal);
    }
  };
  try {
    bool goes_on = phase_ != Phase::kClosed && take(first);
    while (goes_on) goes_on = take([this] { return Step(); });
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
    case Phase::kDiscarding:
      return DiscardRest();
    case Phase::kServing:
    case Phase::kClosed:
      break;
  }
  return false;
}

void Connection::Enter(Phase phase) {
  const Clock::time_point now = Clock::now();
  phase_ = phase;
  switch (phase) {
    case Phase::kHandshake:
    case Phase::kHead:
      return SetDeadline(now + options_.header_timeout);
    case Phase::kIdle:
      return SetDeadline(now + options_.idle_timeout);
    case Phase::kBody:
      last_deadline_ = now + options_.body_timeout + TimeFor(reader_.body_left());
      return SetDeadline(now + options_.body_timeout);
    case Phase::kWaiting:
      return SetDeadline(session_->wait().until);
    case Phase::kSending:
      last_deadline_ =
          now + options_.answer_timeout + TimeFor(answer_.file ? answer_.file->size() : 0);
      return SetDeadline(now + options_.write_timeout);
    case Phase::kDiscarding:
      return SetDeadline(now + kDiscardTime);
    case Phase::kServing:
    case Phase::kClosed:
      return SetDeadline(EventLoop::kNever);
  }
}

bool Connection::Await() {
  context_.loop.Await(socket_.fd(), socket_.awaited());
  return false;
}

bool Connection::End() {
  Close();
  return false;
}

bool Connection::OnTimeout() {
  if (phase_ == Phase::kWaiting) return Serve();
  if (phase_ == Phase::kHead || phase_ == Phase::kBody) {
    throw ProblemError("request_timeout", "The request did not arrive in time. Send it again.");
  }
  return End();  // nobody to tell, or nothing to say
}

bool Connection::Handshake() {
  const bool taken = context_.handshakes.Run([self = shared_from_this()] {
    const ssize_t result = self->socket_.Handshake();
    self->context_.loop.Post([self, result] {
      self->Run([&] {
        if (result <= 0) return result == Socket::kWait ? self->Await() : self->End();
        self->Enter(Phase::kIdle);
        return true;
      });
    });
  });
  return taken ? false : End();
}

bool Connection::Receive() {
  // Of the thread, so that a connection that waits has no buffer.
  thread_local std::array<char, kReceiveBytes> buffer;
  const ssize_t got = socket_.Read(buffer.data(), buffer.size());
  if (got == Socket::kWait) return Await();
  if (got <= 0) {
    socket_.EndSending();  // the client has ended it
    return End();
  }
  reader_.Append({buffer.data(), static_cast<std::size_t>(got)});
  return true;
}

bool Connection::ReceiveHead() {
  while (true) {
    if (phase_ == Phase::kIdle && reader_.HasBytes()) {
      begun_ = Clock::now();
      Enter(Phase::kHead);
    }
    if (reader_.ReadHead()) break;
    if (!Receive()) return false;
  }
  session_ = std::make_shared<Session>(context_.sessions, reader_.head(), peer_, begun_,
                                       served_ + 1 >= kMostRequestsPerConnection);
  address_ = session_->client();
  if (address_ != peer_ && !context_.has_room(*this)) {
    throw ProblemError("busy", kTooManyRequests, {.retry_after_s = 2});
  }
  return Serve();
}

bool Connection::ReceiveBody() {
  const std::uint64_t before = reader_.body_bytes();
  while (!reader_.ReadBody()) {
    const std::uint64_t got = reader_.body_bytes() - before;
    // A long body that comes along gets more time, up to that for the whole; of one in chunks, up
    // to that for what has come.
    if (reader_.has_sink() && got > 0) {
      const auto earned = TimeFor(reader_.body_left() > 0 ? 0 : reader_.body_bytes());
      SetDeadline(std::min(last_deadline_ + earned, Clock::now() + options_.body_timeout));
    }
    if (got >= kMostAtOnce) return Await();
    if (!Receive()) return false;
  }
  session_->TakeBody(reader_.TakeBody(), reader_.body_bytes());
  return Serve();
}

bool Connection::Serve() {
  const bool goes_on = phase_ != Phase::kHead;  // a worker has taken the request before
  subscription_.reset();
  Enter(Phase::kServing);
  Workers& workers = session_->asks_for_health()   ? context_.health
                     : session_->comes_from_peer() ? context_.peers
                                                   : context_.requests;
  const bool taken = workers.Run(
      [self = shared_from_this(), session = session_] {
        const Session::Next next = session->Serve();
        self->context_.loop.Post([=] { self->Run([&] { return self->OnServed(next); }); });
      },
      goes_on);
  if (taken) return false;
  throw ProblemError("busy", kTooManyRequests, {.retry_after_s = 2});
}

bool Connection::OnServed(Session::Next next) {
  if (next == Session::Next::kAnswer) return SendAnswer();
  if (next == Session::Next::kEvent) return AwaitEvent();
  reader_.ReceiveInto(session_->sink());
  reader_.ReadBody();
  // Nothing else is being sent, so a socket that has no room for this is broken.
  if (session_->expects_continue() &&
      socket_.Write(kContinue.data(), kContinue.size()) != std::ssize(kContinue)) {
    return End();
  }
  Enter(Phase::kBody);
  return true;
}

bool Connection::AwaitEvent() {
  Enter(Phase::kWaiting);
  // What the client sends meanwhile is its next request: it has time.
  context_.loop.Await(socket_.fd(), EPOLLRDHUP);
  const auto on_event = [weak = weak_from_this(), session = std::weak_ptr(session_)] {
    const auto self = weak.lock();
    if (!self || self->phase_ != Phase::kWaiting || self->session_ != session.lock()) return;
    self->Run([&] { return self->Serve(); });
  };
  subscription_ =
      session_->wait().subscribe([&loop = context_.loop, on_event] { loop.Post(on_event); });
  return false;
}

bool Connection::Refuse(const ProblemError& error) {
  if (phase_ == Phase::kIdle) begun_ = Clock::now();
  if (!session_) {
    session_ = std::make_shared<Session>(context_.sessions, reader_.head(), peer_, begun_, true);
  }
  session_->Refuse(error.problem(), reader_.body_bytes());
  return SendAnswer();
}

void Connection::TurnAway() {
  if (!socket_.encrypted()) {
    Refuse({"busy", "Too many connections. Try again shortly.", {.retry_after_s = 2}});
    socket_.Write(answer_.text.data(), answer_.text.size());
  }
  socket_.EndSending();
}

// The request is over, but the client has yet to take the answer.
bool Connection::SendAnswer() {
  answer_ = session_->TakeAnswer();
  sent_ = file_sent_ = 0;
  session_.reset();
  address_ = peer_;
  reader_.Forget();
  ++served_;
  Enter(Phase::kSending);
  return true;
}

// False: nothing is left to send.
bool Connection::Refill() {
  if (sent_ < answer_.text.size()) return true;
  if (!answer_.file || file_sent_ == answer_.file->size()) return false;
  sent_ = 0;
  answer_.text.resize(kFilePieceBytes);
  const std::ptrdiff_t got =
      answer_.file->Read(file_sent_, answer_.text.data(), answer_.text.size());
  if (got <= 0) throw std::runtime_error("a file is shorter than expected");  // more was promised
  answer_.text.resize(static_cast<std::size_t>(got));
  file_sent_ += static_cast<std::uint64_t>(got);
  return true;
}

bool Connection::Send() {
  std::size_t sent_now = 0;
  while (Refill()) {
    const ssize_t sent = sent_now < kMostAtOnce ? socket_.Write(answer_.text.data() + sent_,
                                                                answer_.text.size() - sent_)
                                                : Socket::kWait;
    if (sent > 0) {
      sent_ += static_cast<std::size_t>(sent);
      sent_now += static_cast<std::size_t>(sent);
      continue;
    }
    const std::size_t unsent = answer_.text.size() - sent_;
    if (held_ == 0 && !answer_.file && context_.budget.Take(unsent)) held_ = unsent;
    // Without memory for it, waiting for this client would let all others wait.
    const bool kept = held_ > 0 || answer_.file || unsent <= kAlwaysKeptBytes;
    if (sent != Socket::kWait || !kept) return End();
    if (sent_now > 0) {
      SetDeadline(std::min(last_deadline_, Clock::now() + options_.write_timeout));
    }
    return Await();
  }
  const bool keeps_open = std::exchange(answer_, {}).keeps_open;
  context_.budget.Give(std::exchange(held_, 0));
  if (keeps_open && !context_.sessions.stopping) {
    Enter(Phase::kIdle);
  } else {
    // Not for a connection that waits for a request: clients that only look whether there are bytes
    // to read (cpp-httplib 0.11) take close_notify for a living connection, send the next request
    // and fail, while a bare end makes them connect again. Nothing can be cut off there: every
    // answer was complete by its length.
    socket_.EndSending();
    Enter(Phase::kDiscarding);
  }
  return true;
}

// Closing with unread bytes would reset the connection, and with it the answer (RFC 9112, 9.6).
bool Connection::DiscardRest() {
  ssize_t got = 1;
  while (got > 0 && dropped_ < kMostDroppedBytes) {
    got = socket_.Discard();
    if (got > 0) dropped_ += static_cast<std::size_t>(got);
  }
  return got == Socket::kWait ? Await() : End();
}

void Connection::Drain() {
  if (phase_ == Phase::kHandshake || phase_ == Phase::kIdle) Close();
  if (phase_ == Phase::kWaiting) Run([this] { return Serve(); });
}

void Connection::Close() {
  if (phase_ == Phase::kClosed) return;
  Enter(Phase::kClosed);
  context_.loop.Remove(socket_.fd());
  socket_.Shutdown();
  subscription_.reset();
  session_.reset();
  reader_.Forget();
  context_.budget.Give(std::exchange(held_, 0));
  context_.on_close(shared_from_this());
}

}  // namespace pliant::server
