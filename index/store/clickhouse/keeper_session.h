// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One session with ZooKeeper, over its C library. Only keeper*.cc see it.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include <zookeeper/zookeeper.h>

namespace pliant::clickhouse {

// Codes beside those of zookeeper.h.
constexpr int kNoAnswer = -1000;  // not in time: it may still be done
constexpr int kNotSent = -1001;   // certainly not done

struct KeeperAnswer {
  int code = kNoAnswer;
  std::string text;                // a value, or the path that was made
  std::vector<std::string> names;  // of children
  std::int32_t version = 0;
  std::int64_t made = 0;
  std::int64_t owner = 0;  // the session whose end removes it; 0: none
};

// The session, or the connection, is in trouble; other codes are what the Keeper decided.
bool IsTrouble(int code);

// Thread-safe. Connects in the background, and again after a lost connection, until the session is
// lost. A thread of its own asks the Keeper for a sign of life and removes what was left behind.
class KeeperSession {
 public:
  using Clock = std::chrono::steady_clock;
  struct Call;
  using Pending = std::shared_ptr<Call>;

  // `addresses`: numbers, not names: "10.0.0.1:2181,10.0.0.2:2181".
  KeeperSession(const std::string& addresses, std::chrono::milliseconds timeout);
  ~KeeperSession();
  KeeperSession(const KeeperSession&) = delete;
  KeeperSession& operator=(const KeeperSession&) = delete;

  // Ends it, here and at the Keeper; waits some seconds at most, where that one is silent.
  void Close() noexcept;
  // Ends it here. Does not wait.
  void Abandon() noexcept;

  // False: not in time, the session is lost, or `stop`.
  bool WaitConnected(Clock::time_point until, const std::stop_token& stop);
  // For good. Also when the Keeper has been silent for so long that it may have ended it.
  bool lost() const;
  std::int64_t id() const;

  // Paths are absolute.
  Pending Get(const std::string& path, bool watch = false);
  Pending Exists(const std::string& path);
  Pending Children(const std::string& path);
  Pending Create(const std::string& path, const std::string& text, int mode);
  Pending Set(const std::string& path, const std::string& text, std::int32_t version);
  // What is asked afterwards knows of everything that was done before, also by another connection.
  Pending Sync(bool beat = false);
  // `then`: called with the answer's code in a thread of the library, when it was sent.
  Pending Delete(const std::string& path, std::function<void(int)> then = {});
  KeeperAnswer Wait(const Pending& call, Clock::time_point until, const std::stop_token& stop);

  // A node that is about to go. Make it before Get(path, true).
  class Watch {
   public:
    Watch(KeeperSession& session, const std::string& path);
    ~Watch();
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;
    // Until something happens to the node, or the session is lost.
    void Wait(Clock::time_point until, const std::stop_token& stop);

   private:
    KeeperSession& session_;
    const std::string path_;
    std::uint64_t seen_ = 0;
  };

  // A lease is one attempt a path and session: what is found there is then its own.
  bool Reserve(const std::string& path);
  void Release(const std::string& path);

  // What shall be removed while the session lasts, and is gone with it otherwise: the node of a
  // lease, or those of a lock, in `dir`, and `dir` when nothing is left in it.
  struct Garbage {
    std::string node;      // empty: not known
    std::string dir;       // empty: a lease
    std::string prefix;    // of the lock's nodes
    bool unclear = false;  // whether it was made, or how often
  };
  void Remove(Garbage garbage) noexcept;

 private:
  struct Watched {
    int watches = 0;
    std::uint64_t events = 0;
  };

  static void OnEvent(zhandle_t* handle, int type, int state, const char* path, void* context);
  Pending Send(const std::function<int(zhandle_t*, const void*)>& send, bool beat = false,
               std::function<void(int)> then = {});
  void Work(const std::stop_token& stop);
  void Keep(Garbage garbage);
  bool Tidy(const Garbage& garbage, Clock::time_point until, const std::stop_token& stop);
  bool TidyLease(const std::string& node, Clock::time_point until, const std::stop_token& stop);

  mutable std::mutex mutex_;  // guards what follows, up to handle_mutex_
  mutable std::condition_variable_any changed_;
  std::unordered_map<const Call*, Pending> calls_;
  std::map<std::string, Watched> watched_;
  std::set<std::string> reserved_;
  std::deque<Garbage> garbage_;
  bool connected_ = false;
  bool beat_now_ = false;
  std::int64_t id_ = 0;
  mutable bool lost_ = false;
  std::chrono::nanoseconds limit_;  // of silence
  std::chrono::nanoseconds heard_;  // when the last question was sent that was answered

  std::mutex handle_mutex_;  // guards handle_: nobody sends while it is closed
  zhandle_t* handle_ = nullptr;
  std::jthread worker_;
};

}  // namespace pliant::clickhouse
