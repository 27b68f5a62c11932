// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/postgres/pg_monitor.h"

#include <chrono>
#include <optional>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"

namespace pliant::postgres {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kBeat{2000};
constexpr milliseconds kAgain{200};  // after a connection was lost
constexpr milliseconds kLook{100};   // how fast the thread ends

}  // namespace

PgMonitor::PgMonitor(const Address* address)
    : address_(*address), thread_([this](const std::stop_token& stop) { Run(stop); }) {
  health_.answered_ms = SteadyMs();
}

PgMonitor::~PgMonitor() = default;

std::jthread PgMonitor::OnCommit(std::function<void()> wake) {
  return std::jthread([this, wake = std::move(wake)](const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (changed_.wait(lock, stop, [&] { return noticed_; })) {
      noticed_ = false;
      lock.unlock();
      wake();
      lock.lock();
    }
  });
}

const std::string& PgMonitor::Owner() {
  std::unique_lock lock(mutex_);
  if (owner_.empty()) owner_ = RandomHex(32);
  // Not before others can know that it lives.
  const bool known = changed_.wait_for(lock, std::chrono::seconds(10), [&] { return beaten_; });
  if (!known) {
    throw Error(ErrorCode::kUnavailable, "database_unavailable",
                "the database " + address_.shown + " cannot be reached; try again later");
  }
  return owner_;
}

bool PgMonitor::Lives(Connection& db, const std::string& owner) const {
  {
    const std::lock_guard lock(mutex_);
    if (steady_since_ms_ == 0 || SteadyMs() - steady_since_ms_ < kLivesS * 1000) return true;
  }
  Cursor row = db.Prepare(
      "SELECT seen > clock_timestamp() - make_interval(secs => ?2) FROM processes WHERE id = ?1");
  return row.Bind(owner, static_cast<double>(kLivesS)).Next() && row.Int(0) != 0;
}

void PgMonitor::Beat(PgConnection& db) {
  std::string owner;
  {
    const std::lock_guard lock(mutex_);
    owner = owner_;
  }
  if (owner.empty()) {
    db.Exec("SELECT 1");
    return;
  }
  db.Prepare(
        "INSERT INTO processes (id, seen) VALUES (?, clock_timestamp()) "
        "ON CONFLICT (id) DO UPDATE SET seen = excluded.seen")
      .Bind(owner)
      .Run();
  db.Exec("DELETE FROM processes WHERE seen < clock_timestamp() - interval '1 day'");
  const std::lock_guard lock(mutex_);
  beaten_ = true;
  changed_.notify_all();
}

void PgMonitor::Run(const std::stop_token& stop) {
  std::optional<PgConnection> db;
  std::int64_t next_ms = 0;
  while (!stop.stop_requested()) {
    try {
      if (!db) {
        // Others need not wait for a standby to hear that this process lives.
        db.emplace(
            &address_, nullptr,
            PgConnection::Options{.settings = "SET synchronous_commit = off; LISTEN pliant"});
        next_ms = 0;
      }
      bool beat_soon = false;
      {
        const std::lock_guard lock(mutex_);
        beat_soon = !owner_.empty() && !beaten_;
      }
      const std::int64_t now = SteadyMs();
      if (now >= next_ms || beat_soon) {
        Beat(*db);
        next_ms = now + kBeat.count();
        health_.answered_ms = SteadyMs();
        const std::lock_guard lock(mutex_);
        if (steady_since_ms_ == 0) steady_since_ms_ = SteadyMs();
      }
      if (db->WaitForNotice(kLook)) {
        const std::lock_guard lock(mutex_);
        noticed_ = true;
        changed_.notify_all();
      }
    } catch (const Error&) {
      // The server is gone, stopped, or primary no more. Whoever asks it hears so himself; here the
      // next one is looked for.
      db.reset();
      ++health_.losses;
      {
        const std::lock_guard lock(mutex_);
        steady_since_ms_ = 0;
      }
      std::this_thread::sleep_for(kAgain);
    }
  }
}

}  // namespace pliant::postgres
