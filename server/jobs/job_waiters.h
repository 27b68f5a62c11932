// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Who wants to hear of the end of a job, without a thread that waits for it.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

namespace pliant::server {

// Thread-safe. Owned by a shared_ptr: what Add() returns may outlive everybody else.
class JobWaiters : public std::enable_shared_from_this<JobWaiters> {
 public:
  using Wake = std::function<void()>;

  // `wake` is called at most once, and not after the returned object is gone. It must not wait, nor
  // call this.
  std::shared_ptr<void> Add(const std::string& id, Wake wake);

  // Calls those who wait for a job that has ended, and forgets them.
  void WakeWhere(const std::function<bool(const std::string& id)>& has_ended);

 private:
  std::mutex mutex_;                                           // guards waiters_
  std::multimap<std::string, std::shared_ptr<Wake>> waiters_;  // by job
};

}  // namespace pliant::server
