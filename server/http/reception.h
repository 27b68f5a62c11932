// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Where connections wait without a thread each: for a greeting, for a request to arrive as a whole,
// for an event that a handler wants, for the client to take an answer, for its end. One thread
// polls them all, so that a thousand slow clients cost memory and nothing else.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/http/connection.h"

namespace pliant::server {

class Exchange;

// A connection and the request on it, if there is one.
struct Visit {
  explicit Visit(std::unique_ptr<Connection> c);
  ~Visit();

  std::unique_ptr<Connection> connection;
  std::unique_ptr<Exchange> exchange;                         // from the head to the answer
  Clock::time_point begun;                                    // first byte of the request
  std::size_t served = 0;                                     // requests
  Clock::time_point greet_by;                                 // TLS
  Connection::Step greeting = Connection::Step::kWantsInput;  // what it came to last
};

// How a visit goes on when it comes back from a thread.
enum class Next {
  kGreet,    // a step of the greeting was taken: see Visit::greeting
  kRequest,  // another request may come
  kBody,     // the head was read, now the body is wanted
  kEvent,    // the handler waits for an event: see Exchange::wait()
  kLinger,   // the answer is the last one, and what the client still sends is not read
  kEnd,      // likewise, and nothing more comes
};

struct ReceptionOptions {
  ConnectionLimits limits;
  std::size_t most_connections = 2048;
  std::size_t most_per_address = 0;  // 0 = no limit
};

class Reception {
 public:
  // What happens elsewhere. Called by the reception's thread, must not wait.
  class Host {
   public:
    virtual ~Host() = default;
    // A head has arrived, or the body after it, or what its handler waited for is over. The visit
    // comes back by Return().
    virtual void OnArrival(std::unique_ptr<Visit> visit) = 0;
    // Something of a TLS greeting has arrived. A step of it takes milliseconds of a core (RSA), so
    // it is taken elsewhere. The visit comes back by Return() with Next::kGreet.
    virtual void OnGreeting(std::unique_ptr<Visit> visit) = 0;
    // Writes the answer to what connection->fault() says.
    virtual void OnFault(Visit& visit) = 0;
    // Writes the answer of a server that has too many connections.
    virtual void OnCrowd(Visit& visit) = 0;
  };

  Reception(ReceptionOptions options, Host* host);
  ~Reception();  // Stop(0)

  void Admit(std::unique_ptr<Connection> connection);
  void Return(std::unique_ptr<Visit> visit, Next next);

  // Ends connections that wait for a request, lets the others finish for at most `deadline`, then
  // cuts them off. Returns how many were cut off. Afterwards whoever comes back is closed at once.
  std::size_t Stop(std::chrono::milliseconds deadline);

 private:
  enum class Phase { kGreeting, kIdle, kHead, kBody, kWaiting, kSending, kLingering };
  struct Guest {
    std::unique_ptr<Visit> visit;
    Phase phase = Phase::kGreeting;
    Next after = Next::kEnd;  // of an answer that is being sent
    Clock::time_point deadline;
    Clock::time_point last_deadline;  // of the whole answer or body
    std::uint64_t ticket = 0;         // kWaiting: the key in waiting_
    std::shared_ptr<void> subscription;
  };
  using Guests = std::unordered_map<int, Guest>;

  void Run();
  void TakeArrivals();
  void Welcome(std::unique_ptr<Visit> visit);
  void Continue(std::unique_ptr<Visit> visit, Next next);
  Guests::iterator Place(std::unique_ptr<Visit> visit);  // among the guests
  void Enter(Guests::iterator guest, Phase phase);
  void Proceed(Guests::iterator guest);  // takes steps until one must wait
  bool Step(Guests::iterator guest);     // one phase's steps; false: waits, or is gone
  bool ReceiveHead(Guests::iterator guest);
  bool Arrived(Guests::iterator guest);
  void AwaitEvent(Guests::iterator guest);
  void EndWait(Guests::iterator guest);  // the handler is to answer now
  bool Send(Guests::iterator guest);
  bool After(Guests::iterator guest, Connection::Step step);
  void Answer(Guests::iterator guest);  // puts the answer to a fault in, and sends it
  std::unique_ptr<Visit> HandOver(Guests::iterator guest);
  void Await(Guests::iterator guest, Connection::Step step);
  void SetDeadline(Guests::iterator guest, Clock::time_point deadline);
  void OnDeadline(Guests::iterator guest);
  void Remove(Guests::iterator guest);
  void Leave(const Visit& visit);
  int MillisecondsToDeadline() const;
  void Wake();
  void EndIdle();
  void WakeWaiting(const std::vector<std::uint64_t>& tickets);

  const ReceptionOptions options_;
  Host& host_;
  int poll_fd_;
  int wake_fd_;

  // Of the reception's thread.
  Guests guests_;
  std::set<std::pair<Clock::time_point, int>> deadlines_;
  std::unordered_map<std::string, std::size_t> by_address_;
  std::map<std::uint64_t, int> waiting_;  // sockets of those in kWaiting, by ticket
  std::uint64_t last_ticket_ = 0;
  bool ending_ = false;  // nobody waits for another request

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::vector<std::unique_ptr<Connection>> admitted_;
  std::vector<std::pair<std::unique_ptr<Visit>, Next>> returned_;
  std::vector<std::uint64_t> woken_;  // tickets
  std::size_t open_ = 0;              // connections, here and at threads
  std::set<int> away_;                // sockets of those at threads
  bool stopping_ = false;
  bool closed_ = false;   // the reception's thread drops its guests
  bool drained_ = false;  // and has done so

  std::thread thread_;
};

}  // namespace pliant::server
