// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the functions of a Keeper share. Only keeper*.cc see it.
#pragma once

#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "descriptor/base/error.h"
#include "index/store/clickhouse/gate.h"
#include "index/store/clickhouse/keeper.h"
#include "index/store/clickhouse/keeper_session.h"

namespace pliant::clickhouse {

using KeeperSend = std::function<KeeperSession::Pending(KeeperSession&)>;

class Keeper::Impl {
 public:
  using Clock = KeeperSession::Clock;

  explicit Impl(KeeperOptions options);
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // Throws kInvalidArgument "keeper_path_invalid".
  std::string Absolute(const std::string& path) const;
  Clock::time_point CallEnd() const { return Clock::now() + options_.timeout; }

  // A session that is connected; a new one when the last was lost.
  std::shared_ptr<KeeperSession> Connected(Clock::time_point until, const std::stop_token& stop);

  // Again when it was certainly not sent. The answer may be trouble.
  KeeperAnswer Try(const KeeperSend& send, Clock::time_point until);
  // Again after any trouble.
  KeeperAnswer AskAgain(const KeeperSend& send, Clock::time_point until);
  // Throws keeper_unavailable after trouble.
  KeeperAnswer AskOnce(const KeeperSend& send, Clock::time_point until);
  void MakeParents(const std::string& absolute, Clock::time_point until);

  Error Unavailable(const std::string& what) const;
  Error Unexpected(int code, const std::string& absolute) const;

  Gate numbers;  // one of them at a time, since only one could succeed

 private:
  const KeeperOptions options_;
  Gate gate_;  // guards what follows
  std::shared_ptr<KeeperSession> session_;
  std::vector<std::future<void>> closing_;  // of sessions that were lost
};

// Others have to do something first, or a connection to be noticed: waits a moment, differently
// each time.
void PauseBriefly();

void CheckKeeperText(const std::string& text);

}  // namespace pliant::clickhouse
