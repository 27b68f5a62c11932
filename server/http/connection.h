// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A client's connection: its socket, TLS, what was received and what is to be sent. It belongs to
// the thread of the event loop, and waits there without a thread of its own: for a handshake, for a
// request to arrive as a whole, for a worker, for an event that a handler wants, for the client to
// take the answer. So a thousand slow clients cost memory and nothing else.
//
// An upload changes threads three times: it is accepted, then received here, then served by a
// worker, then its answer is sent here.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "server/http/event_loop.h"
#include "server/http/request_reader.h"
#include "server/http/session.h"
#include "server/http/tls.h"
#include "server/http/workers.h"

namespace pliant::server {

class Connection;

// What all connections of a server share.
struct ConnectionContext {
  const ConnectionLimits& limits;
  EventLoop& loop;
  Workers& requests;
  Workers& health;      // of those who ask whether the server lives
  Workers& handshakes;  // a step of one takes milliseconds of a core (RSA)
  SessionContext& sessions;
  MemoryBudget& budget;
  std::function<void(const std::shared_ptr<Connection>&)> on_close;  // on the loop's thread
};

// Its functions are called on the loop's thread.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  // Owns the socket and makes it non-blocking. `tls` can be null.
  Connection(ConnectionContext& context, int socket_fd, const TlsContext* tls);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  const std::string& address() const { return address_; }
  void Start();
  // Instead of Start(): answers without reading a request. Under TLS there is no answer.
  void TurnAway(const Problem& problem);
  // The server stops: no other request is received, and nobody waits for an event.
  void Drain();
  void Close();

 private:
  enum class Phase {
    kHandshake,
    kIdle,  // between requests
    kHead,
    kBody,
    kServing,  // by a worker
    kWaiting,  // for an event
    kSending,
    kLingering,  // the last answer was sent: what the client still sends is dropped
    kClosed
  };
  enum class AfterSending { kBody, kRequest, kEnd };

  void OnEvent(EventLoop::Event event);
  void Run(const std::function<bool()>& step);
  void Enter(Phase phase);
  void SetDeadline(Clock::time_point deadline);
  // These take a step and return whether the next one can be taken at once.
  bool Step();
  bool OnTimeout();
  bool Handshake();
  bool OnHandshake(ssize_t result);
  bool ReceiveHead();
  bool ReceiveBody();
  bool Serve();
  bool OnServed();
  bool AwaitEvent();
  bool Refuse(const Problem& problem);
  bool SendAnswer();
  bool Send();
  bool Linger();
  bool Receive();  // into reader_; false: waits, or closed
  bool Await();    // what the socket waits for; false
  bool Refill();   // unsent_ with what comes next
  ssize_t SendSome();
  void EndSending();

  ConnectionContext& context_;
  const int socket_fd_;
  std::unique_ptr<TlsSession> tls_;
  const std::string address_;
  std::uint32_t awaited_;  // events, after a step that could not go on

  Phase phase_ = Phase::kIdle;
  Clock::time_point last_deadline_;  // of the whole body or answer
  Clock::time_point begun_;          // first byte of the request
  int served_ = 0;                   // requests
  RequestReader reader_;
  std::shared_ptr<Session> session_;    // from the head to the answer
  std::shared_ptr<void> subscription_;  // kWaiting

  AfterSending after_ = AfterSending::kEnd;
  std::string unsent_;
  std::size_t sent_ = 0;  // of unsent_
  Session::Answer rest_;  // after unsent_
  std::uint64_t file_sent_ = 0;
  std::size_t held_ = 0;  // of the budget, for what the client has not taken
  std::size_t dropped_ = 0;
};

}  // namespace pliant::server
