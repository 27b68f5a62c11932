// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/http_pool.h"

#include <algorithm>
#include <exception>
#include <numeric>
#include <optional>

#include "index/store/clickhouse/http_hosts.h"
#include "index/store/clickhouse/http_message.h"
#include "index/store/clickhouse/request_watch.h"
#include "index/store/clickhouse/server_error.h"

namespace pliant::clickhouse {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kTailBytes = 8192;        // where an error at the end of an answer is sought
constexpr std::uint64_t kDrainBytes = 1 << 20;  // read on for it after the answer made no sense

milliseconds Left(std::chrono::steady_clock::time_point until) {
  return std::chrono::ceil<milliseconds>(until - std::chrono::steady_clock::now());
}

void RefuseStopped(const DatabaseRequest& request) {
  if (!request.stop.stop_requested()) return;
  throw Error(ErrorCode::kCancelled, "cancelled", "the request to ClickHouse was cancelled");
}

}  // namespace

class HttpPool::Hosts : public HttpHosts {
 public:
  using HttpHosts::HttpHosts;
  RequestWatch watch;
};

// What becomes of one request, over all hosts.
struct HttpPool::Attempt {
  const std::function<void(std::string_view)>& take;
  const std::function<void()>& finish;
  std::function<void()> restart;  // empty: no second host after the first piece

  bool given = false;
  std::uint64_t bytes = 0;
  std::uint64_t drained = 0;
  bool too_large = false;
  bool is_error = false;  // by the answer's head
  bool endless = false;   // by its head, nobody can tell whether all of it has come
  std::string tail = {};
  std::exception_ptr thrown = {};  // by `take`
  std::string failure = {};        // of the last host

  void Begin() {
    if (given) restart();
    given = too_large = is_error = endless = false;
    bytes = drained = 0;
    tail.clear();
    thrown = nullptr;
  }

  bool Receive(std::string_view piece, std::uint64_t most) {
    tail += piece;
    if (tail.size() > 2 * kTailBytes) tail.erase(0, tail.size() - kTailBytes);
    bytes += piece.size();
    if (is_error) return bytes <= kDrainBytes;
    if (thrown) return (drained += piece.size()) <= kDrainBytes;
    if (bytes > most) return !(too_large = true);
    given = true;
    try {
      take(piece);
    } catch (...) {
      thrown = std::current_exception();
    }
    return true;
  }

  void End() {
    if (thrown || is_error) return;
    try {
      finish();
    } catch (...) {
      thrown = std::current_exception();
    }
  }
};

HttpPool::HttpPool(HttpPoolOptions options)
    : options_(std::move(options)), hosts_(std::make_unique<Hosts>(options_)) {}

HttpPool::~HttpPool() = default;

std::string HttpPool::Fetch(const DatabaseRequest& request) {
  std::string body;
  const std::function<void(std::string_view)> take = [&body](std::string_view piece) {
    body += piece;
  };
  const std::function<void()> finish = [] {};
  Attempt attempt{.take = take, .finish = finish, .restart = [&body] { body.clear(); }};
  Run(request, attempt);
  return body;
}

void HttpPool::Stream(const DatabaseRequest& request,
                      const std::function<void(std::string_view)>& take,
                      const std::function<void()>& finish) {
  Attempt attempt{.take = take, .finish = finish, .restart = nullptr};
  Run(request, attempt);
}

void HttpPool::Run(const DatabaseRequest& request, Attempt& attempt) {
  CheckRequest(request);
  const milliseconds timeout = request.timeout.count() > 0 ? request.timeout : options_.timeout;
  const Clock::time_point deadline = Clock::now() + timeout;
  const std::vector<std::size_t> order = hosts_->Order();
  for (std::size_t i = 0; i < order.size(); ++i) {
    const milliseconds left = Left(deadline);
    if (left.count() <= 0) break;
    RefuseStopped(request);
    attempt.Begin();
    // One that hangs leaves the others their share of the time, where they may be asked at all.
    const milliseconds share =
        request.repeatable ? left / static_cast<int>(order.size() - i) : left;
    const Outcome outcome = Try(order[i], request, Clock::now() + share, attempt);
    if (outcome == Outcome::kDone) {
      hosts_->Answered(order[i]);
      return;
    }
    hosts_->Failed(order[i]);
    if (outcome == Outcome::kNotSent) continue;
    if (!request.repeatable || (attempt.given && !attempt.restart)) {
      throw Error(
          ErrorCode::kUnavailable,
          request.repeatable ? "database_unavailable" : "database_outcome_unknown",
          attempt.failure + (request.repeatable ? "" : "; what was asked for may have been done"));
    }
  }
  if (Left(deadline).count() <= 0) {
    throw Error(ErrorCode::kUnavailable, "database_timeout",
                "ClickHouse did not answer within " + std::to_string(timeout.count()) +
                    " ms: " + attempt.failure);
  }
  throw Error(ErrorCode::kUnavailable, "database_unavailable",
              order.size() == 1 ? attempt.failure
                                : "none of " + std::to_string(order.size()) +
                                      " hosts of ClickHouse answers; the last: " + attempt.failure);
}

HttpPool::Outcome HttpPool::Try(std::size_t host, const DatabaseRequest& request,
                                Clock::time_point until, Attempt& attempt) {
  const std::string name = options_.hosts[host].Text();
  httplib::Request message = ToMessage(request, options_);
  message.response_handler = [&attempt](const httplib::Response& head) {
    attempt.is_error = head.status != 200 || head.has_header("X-ClickHouse-Exception-Code");
    attempt.endless = !attempt.is_error && !SaysItsEnd(head);
    return !attempt.endless;
  };
  message.content_receiver = [&](const char* data, std::size_t size, std::uint64_t, std::uint64_t) {
    return attempt.Receive({data, size}, request.max_answer_bytes);
  };
  HttpHosts::Connection connection = hosts_->Take(host);
  const milliseconds left = std::max(Left(until), milliseconds(1));
  connection->set_connection_timeout(std::min(left, options_.connect_timeout));
  connection->set_read_timeout(left + milliseconds(1000));  // the watch ends it before
  connection->set_write_timeout(left + milliseconds(1000));
  std::optional<httplib::Result> result;
  {
    const RequestWatch::Guard guard(hosts_->watch, until, request.stop,
                                    [&connection] { connection->stop(); });
    result.emplace(connection->send(message));
  }
  RefuseStopped(request);
  if (attempt.too_large) {
    throw Error(ErrorCode::kTooLarge, "database_answer_too_large",
                "an answer of ClickHouse has more than " +
                    std::to_string(request.max_answer_bytes) + " bytes");
  }
  const bool complete = static_cast<bool>(*result);
  if (complete) attempt.End();
  // A statement has no rows to be mistaken for an error, so one is looked for in any case.
  if (attempt.is_error || attempt.thrown || IsStatement(request)) {
    if (const auto error = FindServerError(attempt.tail)) {
      if (complete) hosts_->Give(host, std::move(connection));
      throw ToError(*error, name);
    }
  }
  if (attempt.thrown) std::rethrow_exception(attempt.thrown);
  if (complete && attempt.is_error) {
    throw Error(ErrorCode::kUnavailable, "database_unavailable",
                name +
                    " is not ClickHouse's HTTP interface, or something stands before it: it "
                    "answers " +
                    std::to_string((*result)->status));
  }
  if (complete) {
    hosts_->Give(host, std::move(connection));
    return Outcome::kDone;
  }
  attempt.failure = attempt.endless
                        ? name + " does not say where its answer ends; is it ClickHouse?"
                        : DescribeFailure(name, result->error(), Left(until).count() <= 0);
  return WasNotSent(result->error()) ? Outcome::kNotSent : Outcome::kNoAnswer;
}

}  // namespace pliant::clickhouse
