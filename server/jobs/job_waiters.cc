// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/job_waiters.h"

#include <utility>

namespace pliant::server {

std::shared_ptr<void> JobWaiters::Add(const std::string& id, Wake wake) {
  const auto waiter = std::make_shared<Wake>(std::move(wake));
  const auto self = shared_from_this();
  // Made first: what cannot be given back is not taken.
  std::shared_ptr<void> subscription(nullptr, [self, waiter, id](void*) {
    const std::lock_guard lock(self->mutex_);
    const auto [begin, end] = self->waiters_.equal_range(id);
    for (auto it = begin; it != end; ++it) {
      if (it->second != waiter) continue;
      self->waiters_.erase(it);
      return;
    }
  });
  const std::lock_guard lock(mutex_);
  waiters_.emplace(id, waiter);
  return subscription;
}

void JobWaiters::WakeWhere(const std::function<bool(const std::string& id)>& has_ended) {
  const std::lock_guard lock(mutex_);
  for (auto it = waiters_.begin(); it != waiters_.end();) {
    const auto end = waiters_.upper_bound(it->first);
    if (!has_ended(it->first)) {
      it = end;
      continue;
    }
    while (it != end) {
      (*it->second)();
      it = waiters_.erase(it);
    }
  }
}

}  // namespace pliant::server
