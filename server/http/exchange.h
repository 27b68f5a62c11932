// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One request on its way through the HTTP library: checks before the body is read, reading the
// body, running the route's handler, and what is remembered for the log.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <httplib.h>

#include "server/http/allowed_hosts.h"
#include "server/http/compression.h"
#include "server/http/connection.h"
#include "server/http/http_server.h"
#include "server/http/message.h"
#include "server/http/origin_policy.h"
#include "server/http/problem.h"
#include "server/http/router.h"

namespace pliant::server {

// What all exchanges of a server share.
struct ExchangeShared {
  const Router& router;
  const AdmitRequest admit;
  const OriginPolicy origins;
  const AllowedHosts allowed_hosts;
  const bool encrypted = false;
  std::size_t max_body_bytes = 0;
  const int max_waiting = 0;  // requests that wait for an event (Wait); more get "busy"
  std::atomic<bool> ready{false};
  std::atomic<bool> stopping{false};
  std::atomic<int> waiting{0};
  // Long answers at once, on half of the cores: the others are for searches.
  Compressor compressor{std::max(1, static_cast<int>(std::thread::hardware_concurrency()) / 2)};
};

// A request with a body goes through the library twice: when its head is there, and when its body
// is there, too. Used by one thread at a time.
class Exchange {
 public:
  Exchange(ExchangeShared& shared, Connection& connection);
  ~Exchange();
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

  // What the client's Accept-Encoding says, which the library is not to know. Before BeforeBody().
  void NoteAcceptedCodings(std::string codings) { accepted_codings_ = std::move(codings); }
  // Called when the headers are there. Returns true when the answer is complete: an error, or a
  // route that takes no body. The second time it returns the same; after a Wait it runs the handler
  // again.
  bool BeforeBody(const httplib::Request& raw, httplib::Response& answer);
  // Called after it returned false. Returns true when the body has not arrived yet: the library is
  // to be left without an answer, and called again when ReceiveBody() is done.
  bool AwaitsBody(httplib::Response& answer);
  bool awaits_body() const { return awaits_body_; }
  // The handler waits for an event: the library is to be called again when it has happened.
  bool waits() const { return wait_.has_value(); }
  const Wait& wait() const { return *wait_; }
  // Reads the body, then runs the handler.
  void WithBody(const httplib::ContentReader& reader, httplib::Response& answer);
  // Fills an answer that the library made by itself.
  void OnLibraryError(const httplib::Request& raw, httplib::Response& answer);
  void OnException(httplib::Response& answer);
  // What the connection's fault means.
  Problem FaultProblem() const;

  // The connection cannot carry another request, because this one's body was not read to its end.
  bool must_close() const { return must_close_; }
  bool answered() const { return answered_; }
  bool takes_ranges() const { return takes_ranges_; }  // the answer says so
  const std::string& request_id() const { return request_.id; }

  RequestRecord Record(double seconds) const;
  void NoteAnswer(const httplib::Response& answer);

 private:
  void ReadHead(const httplib::Request& raw);
  void CheckFraming(const httplib::Request& raw);
  void CheckLength() const;
  bool ReceivesItself() const;  // the route takes the body, by Route::receive
  void BeginReceiving();
  void CheckHost() const;
  void ReadMultipart(const httplib::ContentReader& reader, const httplib::Response& answer);
  void ReadPlain(const httplib::ContentReader& reader, const httplib::Response& answer);
  ProblemError BodyProblem(bool too_large, bool too_many_parts) const;
  void RunHandler(httplib::Response& answer);
  void BeginWait(Wait wait, httplib::Response& answer);
  void EndWait();
  void LeaveWithoutAnswer(httplib::Response& answer);
  void Answer(Response response, httplib::Response& answer);
  void AnswerWithFile(const std::shared_ptr<const BodyFile>& file, const std::string& content_type,
                      httplib::Response& answer);
  void AddSecurityHeaders(httplib::Response& answer) const;
  void AnswerProblem(const Problem& problem, httplib::Response& answer);

  ExchangeShared& shared_;
  Connection& connection_;
  Request request_;
  const Route* route_ = nullptr;
  bool prepared_ = false;  // BeforeBody has run
  bool complete_ = false;  // and gave the answer
  bool answered_ = false;
  bool awaits_body_ = false;
  std::optional<Wait> wait_;             // counted in shared_.waiting
  std::optional<std::uint64_t> length_;  // of the body, as announced
  bool must_close_ = false;
  bool takes_ranges_ = false;
  std::string accepted_codings_;
  RequestRecord record_;
};

}  // namespace pliant::server
