// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/job_watcher.h"

#include <utility>

#include <spdlog/spdlog.h>

namespace pliant::server {

JobWatcher::JobWatcher(JobStore& store, Adopt adopt) : store_(store), adopt_(std::move(adopt)) {
  Poll();
  thread_ = std::thread([this] {
    while (!store_.StoppedWithin(kPollEvery)) Poll();
  });
}

JobWatcher::~JobWatcher() { thread_.join(); }

void JobWatcher::Poll() try {
  store_.SaveEnds();
  ServiceStore& rows = store_.rows();
  std::set<std::string> waited_for = store_.waiters().Ids();  // before the rows are read
  const std::int64_t version = rows.Version();
  if (version == seen_version_ && !others_work_ && waited_for.empty()) return;
  seen_version_ = -1;  // until all was seen
  others_work_ = false;
  const std::vector<JobRecord> records = rows.Jobs();
  for (const JobRecord& record : records) {
    if (record.finished_ms != 0) continue;
    waited_for.erase(record.id);
    const bool own = record.owner == rows.Owner();
    if (!own) others_work_ = true;
    if (own && record.cancel) store_.CancelOwn(record.id);
    if (own || !rows.Lives(record.owner)) adopt_(record);
  }
  for (const std::string& id : waited_for) store_.waiters().WakeAll(id);
  if (records.size() > JobStore::kMaxJobs) rows.KeepNewestJobs(JobStore::kMaxJobs);
  seen_version_ = version;
  works_ = true;
} catch (const std::exception& error) {
  if (std::exchange(works_, false)) {
    spdlog::warn("cannot read the jobs of other servers: {}", error.what());
  }
}

}  // namespace pliant::server
