// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Leases and locks.
#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include <unistd.h>

#include "index/files/text.h"
#include "index/store/clickhouse/keeper_impl.h"

namespace pliant::clickhouse {
namespace {

constexpr std::size_t kIdDigits = 24;
constexpr std::size_t kSequenceDigits = 10;  // that the Keeper puts behind a name

// The place in the queue, as text of equal length; empty for what is no lock's node.
std::string_view Sequence(std::string_view name) {
  if (name.size() < kSequenceDigits + 1) return {};
  const std::string_view digits = name.substr(name.size() - kSequenceDigits);
  const bool plain =
      std::all_of(digits.begin(), digits.end(), [](char c) { return c >= '0' && c <= '9'; });
  return plain && name[name.size() - kSequenceDigits - 1] == '-' ? digits : std::string_view();
}

// Who has it, for people who look.
std::string Holder() {
  std::array<char, 256> host{};
  if (gethostname(host.data(), host.size() - 1) != 0) host[0] = '\0';
  return std::string(host.data()) + " " + std::to_string(getpid());
}

}  // namespace

struct KeeperLease::Impl {
  std::shared_ptr<KeeperSession> session;
  KeeperSession::Garbage node;
  std::int64_t token = 0;
};

KeeperLease::KeeperLease(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

KeeperLease::~KeeperLease() { impl_->session->Remove(std::move(impl_->node)); }

std::int64_t KeeperLease::token() const { return impl_->token; }

bool KeeperLease::held() const { return !impl_->session->lost(); }

// Taking one thing, in one session. What was made goes again unless it is given away.
class Keeper::Taking {
 public:
  using Clock = KeeperSession::Clock;

  Taking(Impl& keeper, std::string path, Clock::time_point until, std::stop_token stop);
  ~Taking() {
    if (made_) session_->Remove(std::move(node_));
  }
  Taking(const Taking&) = delete;
  Taking& operator=(const Taking&) = delete;

  std::unique_ptr<KeeperLease> Lease(const std::string& text);
  std::unique_ptr<KeeperLease> Lock();

 private:
  void Check() const;
  Clock::time_point CallEnd() const { return std::min(until_, keeper_.CallEnd()); }
  KeeperAnswer Once(const KeeperSend& send) const;
  KeeperAnswer Again(const KeeperSend& send) const;
  bool MakeLease(const std::string& text);
  std::string MakePlace();
  std::string FindPlace() const;
  void WaitForTurn(const std::string& place) const;
  std::unique_ptr<KeeperLease> Give(const std::string& node);

  Impl& keeper_;
  const std::string path_;
  const Clock::time_point until_;
  const std::stop_token stop_;
  std::shared_ptr<KeeperSession> session_;
  KeeperSession::Garbage node_;
  bool made_ = false;  // or perhaps
};

Keeper::Taking::Taking(Impl& keeper, std::string path, Clock::time_point until,
                       std::stop_token stop)
    : keeper_(keeper), path_(std::move(path)), until_(until), stop_(std::move(stop)) {
  Check();
  session_ = keeper_.Connected(CallEnd(), stop_);
}

void Keeper::Taking::Check() const {
  if (stop_.stop_requested()) {
    throw Error(ErrorCode::kCancelled, "cancelled", "waiting for " + path_ + " was cancelled");
  }
  if (session_ && session_->lost()) throw keeper_.Unavailable("the session was lost");
  if (Clock::now() >= until_) {
    throw Error(ErrorCode::kUnavailable, "keeper_busy",
                "others have had the Keeper's " + path_ + " for too long");
  }
}

KeeperAnswer Keeper::Taking::Once(const KeeperSend& send) const {
  Check();
  const Clock::time_point end = CallEnd();
  if (session_->WaitConnected(end, stop_)) {
    KeeperAnswer answer = session_->Wait(send(*session_), end, stop_);
    if (answer.code != kNoAnswer) return answer;
  }
  Check();
  throw keeper_.Unavailable("there was no answer in time");
}

KeeperAnswer Keeper::Taking::Again(const KeeperSend& send) const {
  for (;;) {
    KeeperAnswer answer = Once(send);
    if (!IsTrouble(answer.code)) return answer;
    PauseBriefly();
  }
}

std::unique_ptr<KeeperLease> Keeper::Taking::Lease(const std::string& text) {
  if (!session_->Reserve(path_)) return nullptr;
  node_ = {.node = path_, .dir = "", .prefix = "", .unclear = true};
  made_ = true;
  if (!MakeLease(text)) {
    made_ = false;
    session_->Release(path_);
    return nullptr;
  }
  node_.unclear = false;
  return Give(path_);
}

bool Keeper::Taking::MakeLease(const std::string& text) {
  for (bool unclear = false;;) {
    const KeeperAnswer made =
        Once([&](KeeperSession& session) { return session.Create(path_, text, ZOO_EPHEMERAL); });
    if (made.code == ZOK) return true;
    if (made.code == ZNODEEXISTS && !unclear) return false;
    if (made.code == ZNONODE) {
      keeper_.MakeParents(path_, CallEnd());
      continue;
    }
    if (!IsTrouble(made.code) && made.code != ZNODEEXISTS) {
      throw keeper_.Unexpected(made.code, path_);
    }
    unclear = unclear || made.code != kNotSent;
    const KeeperAnswer there = Again([&](KeeperSession& session) {
      session.Sync();
      return session.Exists(path_);
    });
    if (there.code == ZOK) return there.owner == session_->id();
    PauseBriefly();
  }
}

std::unique_ptr<KeeperLease> Keeper::Taking::Lock() {
  node_ = {.node = "", .dir = path_, .prefix = RandomHex(kIdDigits) + "-", .unclear = true};
  const std::string place = MakePlace();
  WaitForTurn(place.substr(path_.size() + 1));
  return Give(place);
}

std::string Keeper::Taking::MakePlace() {
  const std::string text = Holder();
  for (bool unclear = false;;) {
    made_ = true;
    const KeeperAnswer made = Once([&](KeeperSession& session) {
      return session.Create(path_ + "/" + node_.prefix, text, ZOO_EPHEMERAL | ZOO_SEQUENCE);
    });
    if (made.code == ZOK) {
      if (!unclear) node_.node = made.text;
      node_.unclear = unclear;
      return made.text;
    }
    if (made.code == ZNONODE) {
      keeper_.MakeParents(path_ + "/", CallEnd());
      continue;
    }
    if (!IsTrouble(made.code)) throw keeper_.Unexpected(made.code, path_);
    if (made.code != kNotSent) {
      unclear = true;
      const std::string place = FindPlace();
      if (!place.empty()) return place;
    }
    PauseBriefly();
  }
}

// The node of an attempt that was not answered; empty: none was made.
std::string Keeper::Taking::FindPlace() const {
  const KeeperAnswer all = Again([&](KeeperSession& session) {
    session.Sync();
    return session.Children(path_);
  });
  std::string_view first;
  for (const std::string& name : all.names) {
    if (name.compare(0, node_.prefix.size(), node_.prefix) != 0) continue;
    if (first.empty() || Sequence(name) < Sequence(first)) first = name;
  }
  return first.empty() ? std::string() : path_ + "/" + std::string(first);
}

void Keeper::Taking::WaitForTurn(const std::string& place) const {
  for (;;) {
    const KeeperAnswer all = Again([&](KeeperSession& session) { return session.Children(path_); });
    bool there = false;
    std::string before;
    for (const std::string& name : all.names) {
      there = there || name == place;
      if (Sequence(name) >= Sequence(place)) continue;
      if (Sequence(name) > Sequence(before)) before = name;
    }
    if (!there) throw keeper_.Unavailable("a place in the queue of " + path_ + " is gone");
    if (before.empty()) return;
    // Each waits for the one before it, so that one is woken at a time.
    KeeperSession::Watch watch(*session_, path_ + "/" + before);
    const KeeperAnswer other =
        Again([&](KeeperSession& session) { return session.Get(path_ + "/" + before, true); });
    if (other.code == ZNONODE) continue;
    if (other.code != ZOK) throw keeper_.Unexpected(other.code, path_);
    watch.Wait(until_, stop_);
    Check();
  }
}

std::unique_ptr<KeeperLease> Keeper::Taking::Give(const std::string& node) {
  const KeeperAnswer own = Again([&](KeeperSession& session) { return session.Exists(node); });
  if (own.code != ZOK || own.owner != session_->id() || session_->lost()) {
    throw keeper_.Unavailable("the session was lost");
  }
  auto impl = std::make_unique<KeeperLease::Impl>();
  impl->session = session_;
  impl->node = node_;
  impl->token = own.made;
  std::unique_ptr<KeeperLease> lease(new KeeperLease(std::move(impl)));
  made_ = false;
  return lease;
}

std::unique_ptr<KeeperLease> Keeper::TryLease(const std::string& path, const std::string& text) {
  CheckKeeperText(text);
  Taking taking(*impl_, impl_->Absolute(path), impl_->CallEnd(), {});
  return taking.Lease(text);
}

std::unique_ptr<KeeperLease> Keeper::Lock(const std::string& path,
                                          std::chrono::steady_clock::time_point until,
                                          std::stop_token stop) {
  Taking taking(*impl_, impl_->Absolute(path), until, std::move(stop));
  return taking.Lock();
}

}  // namespace pliant::clickhouse
