// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/job_store.h"

#include <algorithm>
#include <array>
#include <future>

#include <spdlog/spdlog.h>

#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/unix_time.h"

namespace pliant::server {

namespace {

constexpr std::size_t kIdDigits = 16;
constexpr std::array<const char*, 5> kStateNames = {"queued", "running", "done", "failed",
                                                    "cancelled"};  // in the order of JobState

}  // namespace

bool IsActive(JobState state) { return state == JobState::kQueued || state == JobState::kRunning; }

std::string JobStateName(JobState state) { return kStateNames.at(static_cast<std::size_t>(state)); }

void ThrowJobNotFound() {
  throw ProblemError("job_not_found", "No job has this id, or the server has deleted its record.");
}

JobRecord ToRecord(const JobStatus& status, const std::string& owner) {
  Json report = Json::object();
  if (status.problem) {
    report["problem"] = {{"status", status.problem->status},
                         {"code", status.problem->code},
                         {"parameter", status.problem->parameter},
                         {"detail", status.problem->detail}};
  }
  for (const SkippedFile& item : status.skipped) {
    report["skipped"].push_back({item.file, item.code, item.reason});
  }
  if (status.system_files > 0) report["system_files"] = status.system_files;
  return {status, ToText(status.parameters), JobStateName(status.state), ToText(report), owner};
}

JobStatus FromRecord(const JobRecord& record) {
  JobStatus status{record};
  const auto name = std::find(kStateNames.begin(), kStateNames.end(), record.state);
  if (name != kStateNames.end()) status.state = static_cast<JobState>(name - kStateNames.begin());
  const Json parameters = Json::parse(record.parameters, nullptr, /*allow_exceptions=*/false);
  if (parameters.is_object()) status.parameters = parameters;
  try {  // another program may have written anything
    const Json report = Json::parse(record.report);
    for (const Json& item : report.value("skipped", Json::array())) {
      status.skipped.push_back({item.at(0), item.at(1), item.at(2)});
    }
    status.system_files = report.value("system_files", std::uint64_t{0});
    if (const auto problem = report.find("problem"); problem != report.end()) {
      status.problem = Problem{.status = problem->value("status", 500),
                               .code = problem->value("code", "internal"),
                               .detail = problem->value("detail", ""),
                               .parameter = problem->value("parameter", "")};
    }
  } catch (const Json::exception&) {
    status.skipped.clear();
  }
  return status;
}

std::shared_ptr<void> JobWaiters::Add(const std::string& id, Wake wake) {
  const auto waiter = std::make_shared<Wake>(std::move(wake));
  // Made first: what cannot be given back is not taken.
  std::shared_ptr<void> subscription(nullptr, [self = shared_from_this(), waiter, id](void*) {
    const std::lock_guard lock(self->mutex_);
    std::erase_if(self->waiters_, [&](const auto& one) { return one.second == waiter; });
  });
  const std::lock_guard lock(mutex_);
  waiters_.emplace(id, waiter);
  return subscription;
}

std::set<std::string> JobWaiters::Ids() const {
  const std::lock_guard lock(mutex_);
  std::set<std::string> ids;
  for (const auto& [id, wake] : waiters_) ids.insert(id);
  return ids;
}

void JobWaiters::WakeAll(const std::string& id) {
  const std::lock_guard lock(mutex_);
  const auto [begin, end] = waiters_.equal_range(id);
  for (auto it = begin; it != end; ++it) (*it->second)();
  waiters_.erase(begin, end);
}

JobStore::JobStore(ServiceStore& rows, OnEnded on_ended)
    : rows_(rows), on_ended_(std::move(on_ended)) {}

JobStatus JobStore::Add(const std::string& kind, const std::string& collection,
                        const Json& parameters,
                        const std::optional<std::span<const std::uint8_t>>& input) {
  return *AddNew(kind, collection, parameters, [&](const JobRecord& job) {
    if (!input) return rows_.SaveJob(job);
    rows_.AddJob(job, *input);
    return true;
  });
}

std::optional<JobStatus> JobStore::AddOnly(const std::string& kind, const std::string& collection,
                                           const Json& parameters) {
  return AddNew(kind, collection, parameters,
                [this](const JobRecord& job) { return rows_.AddOnlyJob(job); });
}

std::optional<JobStatus> JobStore::AddNew(const std::string& kind, const std::string& collection,
                                          const Json& parameters,
                                          const std::function<bool(const JobRecord& job)>& save) {
  const JobStatus added{
      {.id = RandomHex(kIdDigits), .kind = kind, .collection = collection, .created_ms = NowMs()},
      parameters};
  const auto job = std::make_shared<OwnJob>(OwnJob{.status = added});
  {
    const std::lock_guard lock(mutex_);
    const auto queued = std::count_if(own_.begin(), own_.end(), [](const OwnJobPtr& one) {
      return one->status.state == JobState::kQueued;
    });
    if (static_cast<std::size_t>(queued) >= kMaxQueued) {
      throw ProblemError("busy", "Too many jobs are waiting. Try again later.",
                         {.retry_after_s = 10});
    }
    own_.push_back(job);  // before its row: else JobRunner would adopt it as an unknown one
  }
  bool saved = false;
  {
    const std::shared_ptr<void> ending(nullptr, [&](void*) {
      const std::lock_guard lock(mutex_);
      job->waits = saved;
      if (!saved) std::erase(own_, job);
    });
    saved = save(ToRecord(added, rows_.Owner()));  // what is promised must survive
  }
  if (!saved) return std::nullopt;
  changed_.notify_all();
  return added;
}

JobStore::OwnJobPtr JobStore::FindOwn(const std::string& id) const {
  const auto found = std::find_if(own_.begin(), own_.end(),
                                  [&](const OwnJobPtr& job) { return job->status.id == id; });
  return found == own_.end() ? nullptr : *found;
}

JobStatus JobStore::Get(const std::string& id) const {
  {
    const std::lock_guard lock(mutex_);
    if (const OwnJobPtr job = FindOwn(id)) return job->status;
  }
  for (const JobRecord& record : rows_.Jobs()) {
    if (record.id == id) return FromRecord(record);
  }
  ThrowJobNotFound();
}

std::vector<JobStatus> JobStore::List() const {
  std::vector<JobStatus> list;
  for (const JobRecord& record : rows_.Jobs()) list.push_back(FromRecord(record));
  std::reverse(list.begin(), list.end());
  const std::lock_guard lock(mutex_);
  for (JobStatus& status : list) {
    if (const OwnJobPtr job = FindOwn(status.id)) status = job->status;
  }
  return list;
}

std::optional<JobStatus> JobStore::Active(const std::string& kind,
                                          const std::string& collection) const {
  for (const JobStatus& job : List()) {
    if (job.kind == kind && job.collection == collection && IsActive(job.state)) return job;
  }
  return std::nullopt;
}

std::map<JobState, std::size_t> JobStore::Counts() const {
  std::map<JobState, std::size_t> counts;
  for (const JobStatus& job : List()) ++counts[job.state];
  return counts;
}

JobStatus JobStore::Cancel(const std::string& id) {
  if (const JobStatus job = Get(id); !IsActive(job.state)) return job;
  rows_.RequestCancel(id);  // the end survives a kill, and reaches the server that does the job
  CancelOwn(id);
  return Get(id);
}

void JobStore::CancelOwn(const std::string& id) {
  OwnJobPtr job;
  JobStatus status;
  {
    const std::lock_guard lock(mutex_);
    job = FindOwn(id);
    if (job == nullptr) return;
    job->cancelled = true;
    job->stop.request_stop();
    if (!std::exchange(job->waits, false)) return;  // it runs
    status = job->status;
  }
  status.state = JobState::kCancelled;
  Update(job, std::move(status));
}

std::shared_ptr<void> JobStore::WhenEnded(const std::string& id, JobWaiters::Wake wake) const {
  auto subscription = waiters_->Add(id, std::move(wake));
  const std::lock_guard lock(mutex_);
  const OwnJobPtr job = FindOwn(id);
  if (stopping_ || (job != nullptr && !IsActive(job->status.state))) waiters_->WakeAll(id);
  return subscription;
}

bool JobStore::WaitFor(const std::string& id, std::chrono::milliseconds timeout) const {
  std::promise<void> ended;
  const auto subscription = WhenEnded(id, [&ended] { ended.set_value(); });
  if (!IsActive(Get(id).state)) return true;  // before this asked to be woken
  return ended.get_future().wait_for(timeout) == std::future_status::ready;
}

JobStore::OwnJobPtr JobStore::Take(const std::string& kind) {
  std::unique_lock lock(mutex_);
  OwnJobPtr job;
  changed_.wait(lock, [&] {
    const auto next = std::find_if(own_.begin(), own_.end(), [&](const OwnJobPtr& one) {
      return one->waits && one->status.kind == kind;
    });
    if (next != own_.end()) job = *next;
    return stopping_ || job != nullptr;
  });
  if (stopping_) return nullptr;  // what waits stays queued in the database
  job->waits = false;
  job->status.state = JobState::kRunning;
  ++job->status.attempts;
  job->status.failed = 0;  // of an earlier attempt
  job->status.skipped.clear();
  return job;
}

bool JobStore::Adopt(const std::string& from, const JobStatus& status) {
  {
    const std::lock_guard lock(mutex_);
    if (FindOwn(status.id) != nullptr) return false;
  }
  if (!rows_.TakeJob(status.id, from)) return false;
  const auto job = std::make_shared<OwnJob>(OwnJob{.status = status});
  {
    const std::lock_guard lock(mutex_);
    own_.push_back(job);
    job->waits = status.state == JobState::kQueued;
  }
  changed_.notify_all();
  if (!IsActive(status.state)) Update(job, status);
  return true;
}

bool JobStore::IsOwn(const OwnJobPtr& job) const {
  const std::lock_guard lock(mutex_);
  return std::find(own_.begin(), own_.end(), job) != own_.end();
}

JobStore::OwnJob JobStore::Snapshot(const OwnJobPtr& job) const {
  const std::lock_guard lock(mutex_);
  return *job;
}

void JobStore::Progress(const OwnJobPtr& job, double done, double total) {
  JobStatus status;
  {
    const std::lock_guard lock(mutex_);
    job->status.done = done;
    job->status.total = total;
    const auto now = std::chrono::steady_clock::now();
    if (now - job->saved < kSaveEvery) return;
    job->saved = now;
    status = job->status;
  }
  Save(job, status);
}

void JobStore::Skip(const OwnJobPtr& job, const SkippedFile& item) {
  const std::lock_guard lock(mutex_);
  ++job->status.failed;
  if (job->status.skipped.size() < kMaxSkipped) job->status.skipped.push_back(item);
}

void JobStore::SetSystemFiles(const OwnJobPtr& job, std::uint64_t files) {
  const std::lock_guard lock(mutex_);
  job->status.system_files = files;
}

bool JobStore::Save(const OwnJobPtr& job, const JobStatus& status) {
  try {
    if (rows_.SaveJob(ToRecord(status, rows_.Owner()))) return true;
  } catch (const Error& error) {
    spdlog::warn("cannot save the state of job {}: {}", status.id, error.what());
    return false;
  }
  spdlog::warn("job {} stops on this server: another server has adopted it", status.id);
  const std::lock_guard lock(mutex_);
  std::erase(own_, job);
  job->stop.request_stop();
  return true;
}

void JobStore::Update(const OwnJobPtr& job, JobStatus status) {
  const bool ended = !IsActive(status.state);
  if (ended && status.finished_ms == 0) status.finished_ms = NowMs();
  const bool saved = Save(job, status);
  if (!IsOwn(job)) return;
  {
    const std::lock_guard lock(mutex_);
    job->status = status;
    job->waits = status.state == JobState::kQueued && !stopping_;
    if (ended && saved) std::erase(own_, job);
  }
  changed_.notify_all();
  if (!ended) return;
  if (saved && on_ended_) on_ended_(status);
  waiters_->WakeAll(status.id);
}

void JobStore::SaveEnds() {
  std::vector<std::pair<OwnJobPtr, JobStatus>> unsaved;
  {
    const std::lock_guard lock(mutex_);
    for (const OwnJobPtr& job : own_) {
      if (!IsActive(job->status.state)) unsaved.emplace_back(job, job->status);
    }
  }
  for (const auto& [job, status] : unsaved) Update(job, status);
}

void JobStore::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    for (const OwnJobPtr& job : own_) job->stop.request_stop();
  }
  changed_.notify_all();
  for (const std::string& id : waiters_->Ids()) waiters_->WakeAll(id);
}

bool JobStore::StoppedWithin(std::chrono::milliseconds time) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, time, [&] { return stopping_; });
}

}  // namespace pliant::server
