// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A client's connection: its socket, its received bytes and its unsent bytes. It belongs to the
// thread of the event loop, and waits there without its own thread: for a handshake, a complete
// request, a worker, an event of a handler, or the client to receive the answer. So a thousand slow
// clients cost only memory.
//
// An upload changes threads five times: it is accepted, its head is received here and checked by a
// worker, its body is received here and served by a worker, and its answer is sent here.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include <httplib.h>

#include "server/http/event_loop.h"
#include "server/http/request_reader.h"
#include "server/http/session.h"
#include "server/http/socket.h"

namespace pliant::server {

// Threads of the HTTP library, and a bounded queue of tasks that wait for one. Thread-safe.
class Workers {
 public:
  Workers(int threads, int limit) : limit_(limit), pool_(static_cast<std::size_t>(threads)) {}
  ~Workers() { Finish(); }

  // false = the queue is full; with `past_limit` it takes the task anyway.
  bool Run(std::function<void()> task, bool past_limit = false);
  // Runs the waiting tasks, then ends the threads. From one thread.
  void Finish() {
    if (!std::exchange(finished_, true)) pool_.shutdown();
  }

 private:
  const int limit_;
  std::atomic<int> waiting_{0};
  bool finished_ = false;
  httplib::ThreadPool pool_;
};

class Connection;

// Shared by all connections of a server.
struct ConnectionContext {
  SessionContext sessions;
  std::function<void(const std::shared_ptr<Connection>&)> on_close;  // on the loop's thread
  // Whether its address can have one more connection; on the loop's thread.
  std::function<bool(const Connection&)> has_room;
  MemoryBudget budget{sessions.options.max_inflight_bytes};
  EventLoop loop{};  // outlives the workers, which post to it
  Workers requests{sessions.options.threads, sessions.options.connection_queue};
  // Separate threads for /livez, so that it is answered even if all others are busy.
  Workers health{2, 64};
  // Searches of other servers wait for these, and their searches may be what all other threads wait
  // for.
  Workers peers{sessions.options.peer_threads, sessions.options.connection_queue};
  // A step of a handshake takes milliseconds of a core (RSA): one core, so that others stay free.
  Workers handshakes{1, sessions.options.max_connections};
};

// Its functions are called on the loop's thread.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  // Owns the socket. `tls` can be null.
  Connection(ConnectionContext& context, int socket_fd, const TlsContext* tls);

  // Of the client; of a trusted proxy's connection, of the client whose request is being served.
  const std::string& address() const { return address_; }
  void Start();
  // Instead of Start(): answers "busy" without reading a request. Under TLS there is no answer.
  void TurnAway();
  // The server stops: receive no further request, and end all waits for events.
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
    kDiscarding,  // the last answer was sent: further bytes of the client are dropped
    kClosed
  };

  void Run(const std::function<bool()>& first);
  void Enter(Phase phase);
  void SetDeadline(Clock::time_point at) { context_.loop.SetDeadline(socket_.fd(), at); }
  // These perform a step, and return whether the next step can follow at once.
  bool Step();
  bool OnTimeout();
  bool Handshake();
  bool ReceiveHead();
  bool ReceiveBody();
  bool Serve();
  bool OnServed(Session::Next next);
  bool AwaitEvent();
  bool Refuse(const ProblemError& error);
  bool SendAnswer();
  bool Send();
  bool DiscardRest();
  bool Receive();  // into reader_; false: waits, or closed
  bool Await();    // waits for the socket; returns false
  bool End();      // closes; false
  bool Refill();   // answer_.text with the next piece

  ConnectionContext& context_;
  const HttpOptions& options_;
  Socket socket_;
  const std::string peer_;
  std::string address_;

  Phase phase_ = Phase::kIdle;
  Clock::time_point last_deadline_;  // of the whole body or answer
  Clock::time_point begun_;          // first byte of the request
  int served_ = 0;                   // requests
  RequestReader reader_;
  std::shared_ptr<Session> session_;    // from the head to the answer
  std::shared_ptr<void> subscription_;  // kWaiting

  Session::Answer answer_;  // kSending; its text has the pieces of its file one after another
  std::size_t sent_ = 0;    // of its text
  std::uint64_t file_sent_ = 0;
  std::size_t held_ = 0;  // of the budget, for unsent bytes
  std::size_t dropped_ = 0;
};

}  // namespace pliant::server
