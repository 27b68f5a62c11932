// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/keeper_impl.h"

#include <algorithm>
#include <random>
#include <string_view>
#include <thread>
#include <utility>

#include "index/files/text.h"
#include "index/store/clickhouse/keeper_hosts.h"

namespace pliant::clickhouse {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kMaxPathBytes = 1000;

[[noreturn]] void RefuseOptions(const std::string& what) {
  throw Error(ErrorCode::kInvalidArgument, "keeper_options_invalid", what);
}

// "a/b": parts that need no quotes anywhere.
bool IsPath(std::string_view path) {
  if (path.size() > kMaxPathBytes) return false;
  for (;;) {
    const std::size_t slash = path.find('/');
    const std::string_view part = path.substr(0, slash);
    const bool plain =
        std::all_of(part.begin(), part.end(), [](char c) { return c > ' ' && c < 0x7f; });
    if (part.empty() || part == "." || part == ".." || !plain) return false;
    if (slash == std::string_view::npos) return true;
    path.remove_prefix(slash + 1);
  }
}

}  // namespace

void PauseBriefly() {
  thread_local std::minstd_rand random(std::random_device{}());
  std::this_thread::sleep_for(std::chrono::microseconds(500 + random() % 8000));
}

void CheckKeeperText(const std::string& text) {
  if (text.size() > Keeper::kMaxTextBytes) {
    throw Error(ErrorCode::kTooLarge, "keeper_text_too_large",
                "a text for the Keeper has " + std::to_string(text.size()) + " bytes, and " +
                    std::to_string(Keeper::kMaxTextBytes) + " are the most");
  }
}

Keeper::Impl::Impl(KeeperOptions options) : options_(std::move(options)) {
  if (options_.hosts.empty()) RefuseOptions("a cluster needs the host of at least one Keeper");
  for (const HostPort& host : options_.hosts) {
    if (host.host.empty() || host.port < 1 || host.port > 65535) {
      RefuseOptions("a Keeper has a host and a port, not " + ToDisplayText(host.Text()));
    }
  }
  if (options_.root.empty() || options_.root[0] != '/' || !IsPath(options_.root.substr(1))) {
    RefuseOptions("the Keeper's root is a path like /pliant/DATABASE");
  }
  if (options_.session_timeout < milliseconds(100) ||
      options_.session_timeout > std::chrono::hours(1)) {
    RefuseOptions("the timeout of a Keeper's session is 100 ms to 1 hour");
  }
  if (options_.timeout < milliseconds(1) || options_.timeout > std::chrono::hours(1)) {
    RefuseOptions("the timeout of a call of the Keeper is 1 ms to 1 hour");
  }
}

Keeper::Impl::~Impl() {
  if (session_) session_->Close();
}

std::string Keeper::Impl::Absolute(const std::string& path) const {
  if (!IsPath(path)) {
    throw Error(ErrorCode::kInvalidArgument, "keeper_path_invalid",
                "the Keeper's path \"" + ToDisplayText(path.substr(0, kMaxPathBytes)) +
                    "\" is not of the form jobs/17, in ASCII");
  }
  return options_.root + "/" + path;
}

std::shared_ptr<KeeperSession> Keeper::Impl::Connected(Clock::time_point until,
                                                       const std::stop_token& stop) {
  std::shared_ptr<KeeperSession> session;
  {
    const Gate::Pass pass(gate_, until);
    if (!pass) throw Unavailable("no connection was made in time");
    if (session_ && session_->lost()) {
      session_->Abandon();
      std::erase_if(closing_, [](std::future<void>& one) {
        return one.wait_for(milliseconds(0)) == std::future_status::ready;
      });
      closing_.push_back(std::async(std::launch::async, [lost = session_] { lost->Close(); }));
      session_.reset();
    }
    if (!session_) {
      session_ = std::make_shared<KeeperSession>(FindAddresses(options_.hosts, until),
                                                 options_.session_timeout);
    }
    session = session_;
  }
  if (session->WaitConnected(until, stop)) return session;
  if (stop.stop_requested()) {
    throw Error(ErrorCode::kCancelled, "cancelled", "waiting for the Keeper was cancelled");
  }
  throw Unavailable(session->lost() ? "the session was lost" : "no connection was made in time");
}

KeeperAnswer Keeper::Impl::Try(const KeeperSend& send, Clock::time_point until) {
  for (;;) {
    const std::shared_ptr<KeeperSession> session = Connected(until, {});
    KeeperAnswer answer = session->Wait(send(*session), until, {});
    if (answer.code != kNotSent || Clock::now() >= until) return answer;
    PauseBriefly();
  }
}

KeeperAnswer Keeper::Impl::AskAgain(const KeeperSend& send, Clock::time_point until) {
  for (;;) {
    KeeperAnswer answer = Try(send, until);
    if (!IsTrouble(answer.code)) return answer;
    if (Clock::now() >= until) throw Unavailable("there was no answer in time");
    PauseBriefly();
  }
}

KeeperAnswer Keeper::Impl::AskOnce(const KeeperSend& send, Clock::time_point until) {
  KeeperAnswer answer = Try(send, until);
  if (IsTrouble(answer.code)) {
    throw Unavailable("there was no answer; what was asked for may have been done");
  }
  return answer;
}

void Keeper::Impl::MakeParents(const std::string& absolute, Clock::time_point until) {
  const KeeperAnswer last = AskAgain(
      [&absolute](KeeperSession& session) {
        KeeperSession::Pending pending;
        for (std::size_t at = absolute.find('/', 1); at != std::string::npos;
             at = absolute.find('/', at + 1)) {
          pending = session.Create(absolute.substr(0, at), "", ZOO_PERSISTENT);
        }
        return pending;
      },
      until);
  // None: another one removes what is empty just now; the caller comes again.
  if (last.code != ZOK && last.code != ZNODEEXISTS && last.code != ZNONODE) {
    throw Unexpected(last.code, absolute);
  }
}

Error Keeper::Impl::Unavailable(const std::string& what) const {
  return {ErrorCode::kUnavailable, "keeper_unavailable",
          "the Keeper (" + ListHosts(options_.hosts) + ") is not available: " + what};
}

Error Keeper::Impl::Unexpected(int code, const std::string& absolute) const {
  const std::string where = absolute + " of the Keeper (" + ListHosts(options_.hosts) + ")";
  if (code == ZNOCHILDRENFOREPHEMERALS) {
    return {ErrorCode::kConflict, "keeper_path_leased",
            where + " is below a lease, and nothing can be there"};
  }
  return {ErrorCode::kInternal, "keeper_error", where + " cannot be used: " + zerror(code)};
}

}  // namespace pliant::clickhouse
