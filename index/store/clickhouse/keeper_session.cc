// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/keeper_session.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include "descriptor/base/error.h"

namespace pliant::clickhouse {

struct KeeperSession::Call {
  KeeperSession* session = nullptr;
  std::chrono::nanoseconds sent{0};
  bool done = false;
  KeeperAnswer answer;
  bool beat = false;
  std::function<void(int code)> then;  // called without a lock

  void Finish(int code);
};

namespace {

using std::chrono::nanoseconds;

// Goes on while the machine sleeps, as the Keeper's clock does.
nanoseconds Now() {
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return std::chrono::seconds(now.tv_sec) + nanoseconds(now.tv_nsec);
}

// A Keeper of several machines may have heard of a session a little earlier than the one that
// answers, so a session is given up before its time is over.
nanoseconds Limit(std::chrono::milliseconds timeout) { return nanoseconds(timeout) * 5 / 6; }

KeeperSession::Call& ToCall(const void* data) {
  return *static_cast<KeeperSession::Call*>(const_cast<void*>(data));
}

void TakeStat(KeeperAnswer& answer, const struct Stat* stat) {
  if (stat == nullptr) return;
  answer.version = stat->version;
  answer.made = stat->czxid;
  answer.owner = stat->ephemeralOwner;
}

void OnDone(int code, const void* data) { ToCall(data).Finish(code); }

void OnText(int code, const char* text, const void* data) {
  if (code == ZOK && text != nullptr) ToCall(data).answer.text = text;
  ToCall(data).Finish(code);
}

void OnStat(int code, const struct Stat* stat, const void* data) {
  if (code == ZOK) TakeStat(ToCall(data).answer, stat);
  ToCall(data).Finish(code);
}

void OnValue(int code, const char* value, int size, const struct Stat* stat, const void* data) {
  KeeperAnswer& answer = ToCall(data).answer;
  if (code == ZOK && value != nullptr && size > 0) {
    answer.text.assign(value, static_cast<std::size_t>(size));
  }
  if (code == ZOK) TakeStat(answer, stat);
  ToCall(data).Finish(code);
}

void OnNames(int code, const struct String_vector* names, const void* data) {
  if (code == ZOK && names != nullptr) {
    ToCall(data).answer.names.assign(names->data, names->data + names->count);
  }
  ToCall(data).Finish(code);
}

}  // namespace

bool IsTrouble(int code) {
  switch (code) {
    case kNoAnswer:
    case kNotSent:
    case ZSESSIONEXPIRED:
    case ZSESSIONMOVED:
    case ZCLOSING:
      return true;
    default:
      // Between the two are failures of the system and of the connection.
      return code < ZOK && code > ZAPIERROR && code != ZBADARGUMENTS;
  }
}

// Runs in the library's thread, once for every call that was sent, or never when the session is
// closed before.
void KeeperSession::Call::Finish(int code) {
  KeeperSession& owner = *session;
  Pending self;
  {
    const std::lock_guard lock(owner.mutex_);
    const auto place = owner.calls_.find(this);
    if (place == owner.calls_.end()) return;
    self = std::move(place->second);
    owner.calls_.erase(place);
    answer.code = code;
    done = true;
    if (beat && code == ZOK) owner.heard_ = std::max(owner.heard_, sent);
  }
  owner.changed_.notify_all();
  if (then) then(code);
}

KeeperSession::KeeperSession(const std::string& addresses, std::chrono::milliseconds timeout)
    : limit_(Limit(timeout)), heard_(Now()) {
  static std::once_flag quiet;
  std::call_once(quiet, [] {
    zoo_set_debug_level(static_cast<ZooLogLevel>(0));
    zoo_deterministic_conn_order(1);  // the addresses are in a good order
  });
  handle_ = zookeeper_init(addresses.c_str(), &KeeperSession::OnEvent,
                           static_cast<int>(timeout.count()), nullptr, this, 0);
  if (handle_ == nullptr) {
    throw Error(ErrorCode::kUnavailable, "keeper_unavailable",
                std::string("a session with the Keeper cannot be begun: ") + std::strerror(errno));
  }
  zoo_set_servers_resolution_delay(handle_, -1);  // there are no names among the addresses
  worker_ = std::jthread([this](const std::stop_token& stop) { Work(stop); });
}

KeeperSession::~KeeperSession() { Close(); }

void KeeperSession::Close() noexcept {
  Abandon();
  zhandle_t* handle = nullptr;
  {
    const std::lock_guard lock(handle_mutex_);
    std::swap(handle, handle_);
  }
  if (handle == nullptr) return;
  worker_.request_stop();
  worker_.join();
  zookeeper_close(handle);
  const std::lock_guard lock(mutex_);
  calls_.clear();
}

void KeeperSession::Abandon() noexcept {
  {
    const std::lock_guard lock(mutex_);
    lost_ = true;
  }
  changed_.notify_all();
}

void KeeperSession::OnEvent(zhandle_t* handle, int type, int state, const char* path,
                            void* context) {
  KeeperSession& session = *static_cast<KeeperSession*>(context);
  {
    const std::lock_guard lock(session.mutex_);
    if (type != ZOO_SESSION_EVENT) {
      const auto watched = session.watched_.find(path == nullptr ? "" : path);
      if (watched != session.watched_.end()) ++watched->second.events;
    } else if (state == ZOO_CONNECTED_STATE) {
      session.connected_ = session.beat_now_ = true;
      session.id_ = zoo_client_id(handle)->client_id;
      session.limit_ = Limit(std::chrono::milliseconds(zoo_recv_timeout(handle)));
    } else {
      session.connected_ = false;
      if (state == ZOO_EXPIRED_SESSION_STATE || state == ZOO_AUTH_FAILED_STATE) {
        session.lost_ = true;
      }
    }
  }
  session.changed_.notify_all();
}

bool KeeperSession::WaitConnected(Clock::time_point until, const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  changed_.wait_until(lock, stop, until, [this] { return connected_ || lost_; });
  return connected_ && !lost_;
}

bool KeeperSession::lost() const {
  bool now = false;
  {
    const std::lock_guard lock(mutex_);
    if (lost_) return true;
    now = lost_ = Now() - heard_ > limit_;
  }
  if (now) changed_.notify_all();
  return now;
}

std::int64_t KeeperSession::id() const {
  const std::lock_guard lock(mutex_);
  return id_;
}

KeeperSession::Pending KeeperSession::Send(const std::function<int(zhandle_t*, const void*)>& send,
                                           bool beat, std::function<void(int)> then) {
  const auto call = std::make_shared<Call>();
  call->session = this;
  call->sent = Now();
  call->beat = beat;
  call->then = std::move(then);
  {
    const std::lock_guard lock(mutex_);
    calls_.emplace(call.get(), call);
  }
  int code = ZINVALIDSTATE;
  {
    const std::lock_guard lock(handle_mutex_);
    if (handle_ != nullptr) code = send(handle_, call.get());
  }
  if (code == ZOK) return call;
  const std::lock_guard lock(mutex_);
  calls_.erase(call.get());
  call->answer.code = code == ZBADARGUMENTS ? code : kNotSent;
  call->done = true;
  return call;
}

KeeperSession::Pending KeeperSession::Get(const std::string& path, bool watch) {
  return Send([&](zhandle_t* handle, const void* data) {
    return zoo_aget(handle, path.c_str(), watch ? 1 : 0, OnValue, data);
  });
}

KeeperSession::Pending KeeperSession::Exists(const std::string& path) {
  return Send([&](zhandle_t* handle, const void* data) {
    return zoo_aexists(handle, path.c_str(), 0, OnStat, data);
  });
}

KeeperSession::Pending KeeperSession::Children(const std::string& path) {
  return Send([&](zhandle_t* handle, const void* data) {
    return zoo_aget_children(handle, path.c_str(), 0, OnNames, data);
  });
}

KeeperSession::Pending KeeperSession::Create(const std::string& path, const std::string& text,
                                             int mode) {
  return Send([&](zhandle_t* handle, const void* data) {
    return zoo_acreate(handle, path.c_str(), text.data(), static_cast<int>(text.size()),
                       &ZOO_OPEN_ACL_UNSAFE, mode, OnText, data);
  });
}

KeeperSession::Pending KeeperSession::Set(const std::string& path, const std::string& text,
                                          std::int32_t version) {
  return Send([&](zhandle_t* handle, const void* data) {
    return zoo_aset(handle, path.c_str(), text.data(), static_cast<int>(text.size()), version,
                    OnStat, data);
  });
}

KeeperSession::Pending KeeperSession::Sync(bool beat) {
  return Send(
      [](zhandle_t* handle, const void* data) { return zoo_async(handle, "/", OnText, data); },
      beat);
}

KeeperSession::Pending KeeperSession::Delete(const std::string& path,
                                             std::function<void(int)> then) {
  return Send([&](zhandle_t* handle,
                  const void* data) { return zoo_adelete(handle, path.c_str(), -1, OnDone, data); },
              false, std::move(then));
}

KeeperAnswer KeeperSession::Wait(const Pending& call, Clock::time_point until,
                                 const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  changed_.wait_until(lock, stop, until, [&] { return call->done || lost_; });
  return call->done ? call->answer : KeeperAnswer{};
}

}  // namespace pliant::clickhouse
