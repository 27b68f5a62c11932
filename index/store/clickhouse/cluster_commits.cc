// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/cluster_commits.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "descriptor/base/error.h"

namespace pliant::clickhouse {
namespace {

constexpr std::chrono::seconds kWaitForTurn{30};
constexpr std::uint64_t kNumbersTogether = 1000;
constexpr const char* kUnfinished = "unfinished";  // rows may be written that are not committed
constexpr const char* kPictureNumbers = "numbers/picture";
constexpr const char* kKeyNumbers = "numbers/key";

std::uint64_t NowUs() {
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::microseconds>(
                                        std::chrono::system_clock::now().time_since_epoch())
                                        .count());
}

void RequireHeld(const KeeperLease& lease) {
  if (lease.held()) return;
  throw Error(ErrorCode::kUnavailable, "database_outcome_unknown",
              "the lock for writing was lost before everything was written: it may or may not be "
              "done; look, and try again");
}

}  // namespace

void ClusterCommits::Begin(std::function<void()> after_commit) {
  after_commit_ = std::move(after_commit);
}

void ClusterCommits::Run(Work work, const Foreseen& foreseen, bool alone) {
  if (!after_commit_) {
    throw Error(ErrorCode::kReadOnly, "read_only", "this database was opened for reading only");
  }
  Submit(std::move(work), foreseen, alone);
}

void ClusterCommits::RunAtOpening(Work work, bool alone) { Submit(std::move(work), {}, alone); }

void ClusterCommits::Submit(Work work, const Foreseen& foreseen, bool alone) {
  Job job;
  job.alone = alone;
  job.work = std::move(work);
  job.foreseen = &foreseen;
  queue_.Run(job, [this](std::span<GroupQueue::Job* const> batch) { Execute(batch); });
}

void ClusterCommits::Execute(std::span<GroupQueue::Job* const> batch) noexcept {
  bool committed = false;
  try {
    committed = Commit(batch);
  } catch (...) {
    for (GroupQueue::Job* job : batch) {
      if (!job->failure) job->failure = std::current_exception();
    }
    return;
  }
  try {
    if (committed && after_commit_) after_commit_();
  } catch (...) {
    // What was written is durable and must be reported so; the next search follows, or says why
    // not.
  }
}

// False: there was nothing to write.
bool ClusterCommits::Commit(std::span<GroupQueue::Job* const> batch) {
  const std::unique_ptr<KeeperLease> lease =
      keeper_->Lock(kWriteLock, std::chrono::steady_clock::now() + kWaitForTurn);
  link_.FollowQuorum();
  if (keeper_->Read(kUnfinished)) Recover();
  const Snapshot now = snapshots_.NowForWriting();
  WriteBatch changes(&link_, now, {[this] { return NextPicture(); }, [this] { return NextKey(); }},
                     std::max(NowUs(), now.log + 1));
  Foreseen all;
  for (const GroupQueue::Job* each : batch) {
    const Foreseen& one = *static_cast<const Job*>(each)->foreseen;
    all.pictures.insert(all.pictures.end(), one.pictures.begin(), one.pictures.end());
    all.sha256.insert(all.sha256.end(), one.sha256.begin(), one.sha256.end());
  }
  changes.Foresee(all);
  for (GroupQueue::Job* each : batch) {
    auto* job = static_cast<Job*>(each);
    try {
      changes.Run(job->work);
    } catch (...) {
      job->failure = std::current_exception();
    }
  }
  if (changes.empty()) return false;
  const bool marked = changes.HasCommit();
  if (marked) keeper_->Create(kUnfinished, "");
  RequireHeld(*lease);
  changes.WriteRows();
  RequireHeld(*lease);
  changes.WriteLog();
  RequireHeld(*lease);
  // Left behind, it costs the next writer a look.
  try {
    if (marked) keeper_->Remove(kUnfinished);
  } catch (const Error&) {
  }
  return true;
}

// Rows that no commit knows: commits them, in the order of their versions. Those of the registry
// are seen by who reads it anew: that somebody has changed it is said.
void ClusterCommits::Recover() {
  const Snapshot now = snapshots_.NowForWriting();
  const std::string newer = "version > " + std::to_string(now.log);
  std::vector<NewCommit> commits;
  const std::string statement =
      "SELECT version, collection, id, deleted, picture, object, before FROM (SELECT version, "
      "collection, id, deleted, picture, object FROM pictures WHERE " +
      newer +
      ") ANY LEFT JOIN (SELECT collection, id, max(version) AS before FROM pictures WHERE version "
      "<= " +
      std::to_string(now.log) +
      " AND (collection, id) IN (SELECT collection, id FROM pictures "
      "WHERE " +
      newer + ") GROUP BY collection, id) USING collection, id";
  for (const NativeBlock& block : link_.ReadEach(statement, {{"version", "UInt64"},
                                                             {"collection", "UInt32"},
                                                             {"id", "String"},
                                                             {"deleted", "UInt8"},
                                                             {"picture", "UInt32"},
                                                             {"object", "String"},
                                                             {"before", "UInt64"}})) {
    for (std::size_t i = 0; i < block.rows; ++i) {
      const Row row(block, i);
      NewCommit commit;
      commit.state.version = row.Number(0);
      commit.state.collection = static_cast<std::uint32_t>(row.Number(1));
      commit.state.record.id = row.Text(2);
      commit.state.deleted = row.Number(3) != 0;
      commit.state.picture = static_cast<std::uint32_t>(row.Number(4));
      commit.state.record.object = row.Text(5);
      commit.before = row.Number(6);
      commits.push_back(std::move(commit));
    }
  }
  std::sort(commits.begin(), commits.end(), [](const NewCommit& a, const NewCommit& b) {
    return a.state.version < b.state.version;
  });
  const NativeBlock common = link_.Read(
      ClusterLink::kHome,
      "SELECT max(version) AS newest FROM registry WHERE kind IN " + std::string(kCommonKinds),
      {{"newest", "UInt64"}});
  const std::uint64_t of_registry = common.rows == 0 ? 0 : Row(common, 0).Number(0);
  const std::uint64_t newest = commits.empty() ? now.log : commits.back().state.version;
  const bool behind = of_registry > now.registry->version;
  if (behind || !commits.empty()) {
    WriteLogRows(link_, commits, behind ? std::max(of_registry, newest) + 1 : 0);
  }
  keeper_->Remove(kUnfinished);
}

std::uint32_t ClusterCommits::GreatestPicture() {
  std::uint64_t greatest = 0;
  for (const char* table : {"features", "pictures", "words"}) {
    for (const NativeBlock& block :
         link_.ReadEach(std::string("SELECT max(picture) AS greatest FROM ") + table,
                        {{"greatest", "UInt32"}})) {
      if (block.rows > 0) greatest = std::max(greatest, Row(block, 0).Number(0));
    }
  }
  return static_cast<std::uint32_t>(greatest);
}

std::uint32_t ClusterCommits::NextPicture() {
  if (next_picture_ == end_picture_) {
    // Where the Keeper has lost its counter, it begins behind what there is.
    const std::uint64_t start =
        keeper_->Read(kPictureNumbers) ? 1 : std::uint64_t{GreatestPicture()} + 1;
    next_picture_ = keeper_->TakeNumbers(kPictureNumbers, kNumbersTogether, start);
    end_picture_ = next_picture_ + kNumbersTogether;
  }
  if (next_picture_ > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::kNoSpace, "numbers_exhausted",
                "the cluster has given out all its picture numbers; copy it into a new one");
  }
  return static_cast<std::uint32_t>(next_picture_++);
}

Key ClusterCommits::GreatestKey() {
  // Of those that are gone, too: their rows stay.
  const NativeBlock rows =
      link_.Read(ClusterLink::kHome,
                 "SELECT kind, name, toUInt8(0) AS gone, body FROM registry WHERE kind IN "
                 "('collection', 'vocabulary')",
                 {{"kind", "String"}, {"name", "String"}, {"gone", "UInt8"}, {"body", "String"}});
  Key greatest = 0;
  for (std::size_t i = 0; i < rows.rows; ++i) {
    const Row row(rows, i);
    Registry one;
    Apply({row.Text(0), row.Text(1), false, row.Text(3)}, one);
    for (const auto& [name, entry] : one.collections) greatest = std::max<Key>(greatest, entry.key);
    for (const auto& [key, entry] : one.vocabularies) greatest = std::max(greatest, key);
  }
  return greatest;
}

Key ClusterCommits::NextKey() {
  const std::uint64_t start =
      keeper_->Read(kKeyNumbers) ? 1 : static_cast<std::uint64_t>(GreatestKey()) + 1;
  return static_cast<Key>(keeper_->TakeNumbers(kKeyNumbers, 1, start));
}

}  // namespace pliant::clickhouse
