// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/job_runner.h"

#include <exception>
#include <utility>

#include <spdlog/spdlog.h>

#include "descriptor/base/error.h"

namespace pliant::server {

namespace {

constexpr int kUnavailable = 503;
constexpr std::chrono::seconds kPauseWhenUnavailable{1};

}  // namespace

JobRunner::~JobRunner() {
  store_.Stop();
  for (std::thread& thread : threads_) thread.join();
}

void JobRunner::Register(const std::string& kind, JobKind how) {
  kinds_.emplace(kind, std::move(how));
}

void JobRunner::Start() {
  Poll();
  threads_.emplace_back([this] {
    while (!store_.StoppedWithin(kPollEvery)) Poll();
  });
  for (const auto& [kind, how] : kinds_) {
    threads_.emplace_back([this, name = kind] { Run(name); });
  }
}

void JobRunner::Poll() try {
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
    if (own || !rows.Lives(record.owner)) Adopt(record);
  }
  for (const std::string& id : waited_for) store_.waiters().WakeAll(id);
  if (records.size() > JobStore::kMaxJobs) rows.KeepNewestJobs(JobStore::kMaxJobs);
  seen_version_ = version;
  reads_ = true;
} catch (const std::exception& error) {
  if (std::exchange(reads_, false)) {
    spdlog::warn("cannot read the jobs of other servers: {}", error.what());
  }
}

bool JobRunner::MayBegin(const JobStatus& status) const {
  const auto kind = kinds_.find(status.kind);
  if (kind == kinds_.end()) return false;
  return status.state == JobState::kQueued ||
         (kind->second.resumes && status.attempts < kMaxAttempts);
}

void JobRunner::Adopt(const JobRecord& record) {
  JobStatus status = FromRecord(record);
  const bool runs = status.state == JobState::kRunning;
  if (record.cancel) {
    status.state = JobState::kCancelled;
  } else if (MayBegin(status)) {
    status.state = JobState::kQueued;
  } else {
    status.state = JobState::kFailed;
    status.problem =
        ProblemError("interrupted", "The server stopped during this job. Start the job again.")
            .problem();
  }
  if (store_.Adopt(record.owner, status) && runs && status.state == JobState::kQueued) {
    spdlog::info("job {} ({}) starts again", status.id, status.kind);
  }
}

void JobRunner::Run(const std::string& kind) {
  while (const JobStore::OwnJobPtr job = store_.Take(kind)) {
    store_.Save(job, store_.Snapshot(job).status);
    if (store_.IsOwn(job)) Execute(job);
  }
}

void JobRunner::Execute(const JobStore::OwnJobPtr& job) {
  const JobContext context{
      job->stop.get_token(),
      [this, &job](double done, double total) { store_.Progress(job, done, total); },
      [this, &job](const SkippedFile& item) { store_.Skip(job, item); },
      [this, &job](std::uint64_t files) { store_.SetSystemFiles(job, files); }};
  const JobStatus status = store_.Snapshot(job).status;
  std::string result;
  std::optional<Problem> problem;
  bool stopped = false;
  try {
    result = kinds_.at(status.kind).run(status, context);
  } catch (const Error& error) {
    stopped = error.code() == ErrorCode::kCancelled;
    problem = CurrentProblem();
  } catch (...) {
    problem = CurrentProblem();
  }
  Finish(job, result, std::move(problem), stopped);
}

void JobRunner::Finish(const JobStore::OwnJobPtr& job, const std::string& result,
                       std::optional<Problem> problem, bool stopped) {
  const bool again =
      problem && problem->status == kUnavailable && MayBegin(store_.Snapshot(job).status);
  // A database that is away would use up all attempts at once.
  while (again && !store_.Save(job, store_.Snapshot(job).status) &&
         !store_.StoppedWithin(kPauseWhenUnavailable)) {
  }
  if (!store_.IsOwn(job)) return;
  JobStore::OwnJob own = store_.Snapshot(job);
  JobStatus& status = own.status;
  const bool stopping = store_.StoppedWithin(std::chrono::milliseconds(0));
  if (!problem) {
    status.result = result;
    status.done = status.total;
    status.state = JobState::kDone;
  } else if (own.cancelled && (stopped || again)) {
    status.state = JobState::kCancelled;
  } else if (stopping && (stopped || again || problem->code == "stopping")) {
    --status.attempts;  // the job is not at fault
    status.state = JobState::kQueued;
  } else if (again) {
    spdlog::warn("job {} ({}) starts again: {} {}", status.id, status.kind, problem->code,
                 problem->internal);
    status.state = JobState::kQueued;
  } else {
    spdlog::error("job {} ({}) failed: {} {} {}", status.id, status.kind, problem->code,
                  problem->detail, problem->internal);
    status.problem = std::move(problem);
    status.state = JobState::kFailed;
  }
  store_.Update(job, std::move(status));
}

}  // namespace pliant::server
