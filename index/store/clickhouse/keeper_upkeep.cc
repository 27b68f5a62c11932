// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a session does by itself: signs of life, watches, and removing what was left behind.
#include <algorithm>
#include <utility>

#include "index/store/clickhouse/keeper_session.h"

namespace pliant::clickhouse {

KeeperSession::Watch::Watch(KeeperSession& session, const std::string& path)
    : session_(session), path_(path) {
  const std::lock_guard lock(session_.mutex_);
  Watched& watched = session_.watched_[path_];
  ++watched.watches;
  seen_ = watched.events;
}

KeeperSession::Watch::~Watch() {
  const std::lock_guard lock(session_.mutex_);
  const auto watched = session_.watched_.find(path_);
  if (--watched->second.watches == 0) session_.watched_.erase(watched);
}

void KeeperSession::Watch::Wait(Clock::time_point until, const std::stop_token& stop) {
  std::unique_lock lock(session_.mutex_);
  session_.changed_.wait_until(lock, stop, until, [this] {
    return session_.lost_ || session_.watched_.at(path_).events != seen_;
  });
}

bool KeeperSession::Reserve(const std::string& path) {
  const std::lock_guard lock(mutex_);
  return reserved_.insert(path).second;
}

void KeeperSession::Release(const std::string& path) {
  const std::lock_guard lock(mutex_);
  reserved_.erase(path);
}

void KeeperSession::Remove(Garbage garbage) noexcept {
  try {
    if (garbage.node.empty() || garbage.unclear) {
      Keep(std::move(garbage));
      return;
    }
    // Sent at once, since others wait for it; what fails is done again by the worker.
    const auto then = [this, garbage](int code) {
      if (IsTrouble(code)) {
        Garbage again = garbage;
        again.unclear = true;
        Keep(std::move(again));
      } else if (garbage.dir.empty()) {
        Release(garbage.node);
      }
    };
    const Pending sent = Delete(garbage.node, then);
    if (!garbage.dir.empty()) Delete(garbage.dir);
    const KeeperAnswer answer = Wait(sent, Clock::time_point::min(), {});
    if (answer.code == kNotSent) Keep(std::move(garbage));
  } catch (...) {  // no memory: it goes with the session
  }
}

void KeeperSession::Keep(Garbage garbage) {
  {
    const std::lock_guard lock(mutex_);
    if (lost_) return;
    garbage_.push_back(std::move(garbage));
  }
  changed_.notify_all();
}

void KeeperSession::Work(const std::stop_token& stop) {
  Clock::time_point next = Clock::now();
  bool rest = false;  // the last removal failed
  while (!stop.stop_requested() && !lost()) {
    Garbage garbage;
    bool beat = false;
    bool tidy = false;
    {
      std::unique_lock lock(mutex_);
      changed_.wait_until(lock, stop, next, [&] {
        return beat_now_ || lost_ || (connected_ && !rest && !garbage_.empty());
      });
      if (lost_) return;
      const Clock::time_point now = Clock::now();
      beat = connected_ && (beat_now_ || now >= next);
      if (now >= next || beat) {
        rest = beat_now_ = false;
        next = now + std::chrono::duration_cast<Clock::duration>(limit_ / 5);
      }
      tidy = connected_ && !rest && !garbage_.empty();
      if (tidy) {
        garbage = std::move(garbage_.front());
        garbage_.pop_front();
      }
    }
    if (beat) Sync(true);  // only the leader of all Keepers can answer it
    if (tidy && !Tidy(garbage, next, stop)) {
      rest = true;
      Keep(std::move(garbage));
    }
  }
}

// Whether it is gone.
bool KeeperSession::Tidy(const Garbage& garbage, Clock::time_point until,
                         const std::stop_token& stop) {
  if (garbage.dir.empty()) return TidyLease(garbage.node, until, stop);
  Sync();
  const KeeperAnswer all = Wait(Children(garbage.dir), until, stop);
  if (IsTrouble(all.code)) return false;
  for (const std::string& name : all.names) {
    if (name.compare(0, garbage.prefix.size(), garbage.prefix) != 0) continue;
    const KeeperAnswer gone = Wait(Delete(garbage.dir + "/" + name), until, stop);
    if (IsTrouble(gone.code)) return false;
  }
  return !IsTrouble(Wait(Delete(garbage.dir), until, stop).code);
}

bool KeeperSession::TidyLease(const std::string& node, Clock::time_point until,
                              const std::stop_token& stop) {
  Sync();
  const KeeperAnswer there = Wait(Exists(node), until, stop);
  if (IsTrouble(there.code)) return false;
  // While it is reserved, nobody but the lease in question can have made it in this session.
  if (there.code == ZOK && there.owner == id()) {
    if (IsTrouble(Wait(Delete(node), until, stop).code)) return false;
  }
  Release(node);
  return true;
}

}  // namespace pliant::clickhouse
