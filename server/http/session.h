// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One request and its answer: checks before the body is read, the handler, the answer's head, and
// the record for the log.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "descriptor/base/parallel.h"
#include "server/http/compression.h"
#include "server/http/forwarded.h"
#include "server/http/http_server.h"
#include "server/http/origin_policy.h"
#include "server/http/request_reader.h"
#include "server/http/router.h"

namespace pliant::server {

inline constexpr int kMostRequestsPerConnection = 1000;

// Shared by all sessions of a server.
struct SessionContext {
  const HttpOptions options;
  const Router& router;
  const OriginPolicy origins{options.allowed_origins};
  const AllowedHosts allowed_hosts{options.host, options.allowed_hosts};
  const TrustedProxies proxies{options.trusted_proxies};
  std::atomic<bool> stopping{false};
  std::atomic<int> waiting{0};  // requests that wait for an event (Wait)
  // Long answers at once, on half of the cores: the others are for searches.
  Compressor compressor{std::max(1, ResolveThreads(0) / 2)};
};

// Used by one thread at a time.
class Session {
 public:
  struct Answer {
    std::string text = {};                      // the head, and the body if it is in memory
    std::shared_ptr<const BodyFile> file = {};  // the body otherwise
    bool keeps_open = false;                    // another request can follow
  };
  enum class Next {
    kBody,   // receive the body
    kEvent,  // wait for the handler's event, see wait()
    kAnswer
  };

  // `begun`: first byte of the request. `is_last`: the connection takes no other after it.
  Session(SessionContext& context, Request head, const std::string& remote_address,
          std::chrono::steady_clock::time_point begun, bool is_last);
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  // The address of the client, also behind a trusted proxy.
  const std::string& client() const { return request_.remote_address; }
  bool asks_for_health() const;
  bool comes_from_peer() const;
  bool expects_continue() const;
  void TakeBody(std::string body, std::uint64_t bytes);
  std::shared_ptr<BodySink> sink() const { return request_.received; }  // for the body; can be null

  // Checks the request and runs its handler as far as possible. Returns what it needs.
  Next Serve();
  const Wait& wait() const { return *wait_; }

  // Answers with the problem; `body_bytes` were received.
  void Refuse(const Problem& problem, std::uint64_t body_bytes);
  Answer TakeAnswer() { return std::move(answer_); }

 private:
  std::optional<Response> Check();
  Next RunHandler();
  Next BeginWait(Wait wait);
  void AnswerProblem(const Problem& problem);
  void MakeAnswer(Response response);
  std::string HeadOf(const Response& response, std::uint64_t bytes) const;

  SessionContext& context_;
  const std::chrono::steady_clock::time_point begun_;
  Request request_;
  const Route* route_ = nullptr;
  bool has_whole_body_ = false;
  bool keeps_open_;
  std::shared_ptr<Wait> wait_;  // counted in context_.waiting
  Answer answer_;
  RequestRecord record_;
};

}  // namespace pliant::server
