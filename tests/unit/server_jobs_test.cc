// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Jobs in memory, what may be imported, and names of backups.
#include <atomic>
#include <fstream>
#include <future>
#include <latch>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include "server/jobs/backups.h"
#include "server/jobs/import_jobs.h"
#include "tests/unit/jobs_fixture.h"

namespace pliant::server {
namespace {

std::string CodeOf(const std::function<void()>& work) {
  try {
    work();
  } catch (const ProblemError& error) {
    return error.problem().code;
  }
  return "";
}

TEST_F(JobsTest, RunReportAndAreRemembered) {
  Jobs jobs(*store_);
  jobs.Register("train", Kind([](const JobStatus& job, const JobContext& context) {
                  EXPECT_EQ(job.parameters, (Json{{"words", 3}}));
                  context.progress(3, 4);
                  context.skipped({"a.png", "image_truncated", "it ends"});
                  return std::string("/result");
                }));
  jobs.Start();
  const JobStatus added = jobs.Add("train", "default", Json{{"words", 3}});
  EXPECT_TRUE(jobs.WaitFor(added.id, kPatience));
  const JobStatus done = jobs.Get(added.id);
  EXPECT_EQ(done.state, JobState::kDone);
  EXPECT_EQ(done.result, "/result");
  EXPECT_EQ(done.done, done.total);
  EXPECT_EQ(done.failed, 1U);
  EXPECT_EQ(jobs.List().size(), 1U);
  EXPECT_FALSE(jobs.Active("train", "default"));
  EXPECT_THROW(jobs.Get("nothing"), ProblemError);
  EXPECT_EQ(jobs.Counts()[JobState::kDone], 1U);

  Jobs later(*store_);  // another run of the server
  later.Start();
  const JobStatus kept = later.Get(added.id);
  EXPECT_EQ(kept.state, JobState::kDone);
  EXPECT_EQ(kept.result, "/result");
  ASSERT_EQ(kept.skipped.size(), 1U);
  EXPECT_EQ(kept.skipped[0].file, "a.png");
  EXPECT_EQ(kept.finished_ms, done.finished_ms);
  EXPECT_EQ(kept.parameters, done.parameters);
}

TEST_F(JobsTest, TellWhoWaitsOfTheirEnd) {
  std::atomic<int> calls{0};
  std::atomic<int> late{0};
  const auto count = [&calls] { ++calls; };
  std::shared_ptr<void> outlives;
  {
    Jobs jobs(*store_);
    jobs.Register("train", Kind(UntilStopped));
    jobs.Start();
    const JobStatus first = jobs.Add("train", "default", Json::object());
    const JobStatus second = jobs.Add("train", "default", Json::object());
    const auto unknown = jobs.WhenEnded("nothing", count);
    EXPECT_TRUE(Eventually([&] { return calls == 1; })) << "there is nothing to wait for";
    const auto told = jobs.WhenEnded(first.id, count);
    const auto told_too = jobs.WhenEnded(first.id, count);
    auto gone = jobs.WhenEnded(first.id, [&late] { ++late; });
    gone.reset();
    outlives = jobs.WhenEnded(second.id, count);
    EXPECT_EQ(calls, 1);
    jobs.Cancel(first.id);
    EXPECT_TRUE(jobs.WaitFor(first.id, kPatience));
    EXPECT_TRUE(Eventually([&] { return calls == 3; }));
    const auto ended = jobs.WhenEnded(first.id, count);
    EXPECT_TRUE(Eventually([&] { return calls == 4; }));
  }
  EXPECT_EQ(calls, 5) << "the end of the queue is an end of waiting";
  EXPECT_EQ(late, 0);
  outlives.reset();
}

TEST_F(JobsTest, FailAndAreCancelled) {
  Jobs jobs(*store_);
  jobs.Register("wait", Kind(UntilStopped));
  jobs.Register("fail", Kind([](const JobStatus&, const JobContext&) -> std::string {
                  throw Error(ErrorCode::kConflict, "no_images", "none");
                }));
  jobs.Start();
  const JobStatus running = jobs.Add("wait", "a", Json::object());
  const JobStatus queued = jobs.Add("wait", "b", Json::object());
  EXPECT_EQ(jobs.Active("wait", "b")->id, queued.id);
  EXPECT_FALSE(jobs.WaitFor(running.id, milliseconds(5)));
  EXPECT_EQ(jobs.Cancel(queued.id).state, JobState::kCancelled);
  // Another kind does not wait for the one that runs.
  const JobStatus failing = jobs.Add("fail", "a", Json::object());
  EXPECT_TRUE(jobs.WaitFor(failing.id, kPatience));
  EXPECT_EQ(jobs.Get(failing.id).state, JobState::kFailed);
  EXPECT_EQ(jobs.Get(failing.id).problem->code, "no_images");
  jobs.Cancel(running.id);
  EXPECT_TRUE(jobs.WaitFor(running.id, kPatience));
  EXPECT_EQ(jobs.Get(running.id).state, JobState::kCancelled);
}

// Another process holds the write lock: rows wait for it, and nobody waits for the rows.
TEST_F(JobsTest, AreShownWhileTheDatabaseIsBusy) {
  Jobs jobs(*store_);
  std::atomic<int> steps{0};
  jobs.Register("train", Kind([&](const JobStatus&, const JobContext& context) {
                  for (; steps < 3; ++steps) {
                    context.progress(steps, 3);
                    std::this_thread::sleep_for(milliseconds(10));
                  }
                  return std::string("/result");
                }));
  jobs.Start();
  auto lock = std::make_unique<SQLite::Database>(database().string(), SQLite::OPEN_READWRITE);
  lock->exec("BEGIN IMMEDIATE");
  auto adding =
      std::async(std::launch::async, [&] { return jobs.Add("train", "default", Json::object()); });
  EXPECT_EQ(adding.wait_for(milliseconds(200)), std::future_status::timeout)
      << "what is promised must be on the disk";
  const auto start = std::chrono::steady_clock::now();
  EXPECT_TRUE(jobs.List().empty());
  EXPECT_TRUE(jobs.Counts().empty());
  EXPECT_FALSE(jobs.Active("train", "default"));
  EXPECT_LT(std::chrono::steady_clock::now() - start, milliseconds(5'000));
  lock->exec("ROLLBACK");
  const std::string id = adding.get().id;
  EXPECT_TRUE(jobs.WaitFor(id, kPatience));
  EXPECT_EQ(steps, 3);
}

// Many changes of one job at once: the last one is what a later server finds.
TEST_F(JobsTest, AreSavedInOrder) {
  std::vector<std::string> ids;
  {
    Jobs jobs(*store_);
    jobs.Register("train", Kind([&](const JobStatus& job, const JobContext& context) {
                    std::vector<std::jthread> helpers;
                    for (int t = 0; t < 4; ++t) {
                      helpers.emplace_back([&] {
                        for (int i = 0; i < 50; ++i) context.progress(i, 50);
                      });
                    }
                    helpers.clear();
                    context.skipped({job.id, "image_truncated", "it ends"});
                    return "/result/" + job.id;
                  }));
    jobs.Start();
    for (int i = 0; i < 8; ++i) ids.push_back(jobs.Add("train", "default", Json::object()).id);
    for (const std::string& id : ids) EXPECT_TRUE(jobs.WaitFor(id, kPatience));
  }
  const std::vector<JobRecord> rows = store_->Jobs();
  ASSERT_EQ(rows.size(), ids.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(rows[i].id, ids[i]);
    EXPECT_EQ(rows[i].state, "done");
    EXPECT_EQ(rows[i].result, "/result/" + ids[i]);
    EXPECT_EQ(rows[i].failed, 1U);
  }
}

TEST_F(JobsTest, ImportsStayInsideTheDirectory) {
  namespace fs = std::filesystem;
  const fs::path inside = folder_ / "inside";
  fs::create_directories(inside / "shelf" / "ümlaut");
  fs::create_directories(folder_ / "outside");
  fs::create_directory_symlink(folder_ / "outside", inside / "link");
  std::ofstream(inside / "file.txt") << "x";
  EXPECT_EQ(ResolveImportFolder(inside, "shelf"), fs::canonical(inside / "shelf"));
  EXPECT_EQ(ResolveImportFolder(inside, "shelf/ümlaut/"), fs::canonical(inside / "shelf/ümlaut"));
  EXPECT_EQ(ResolveImportFolder(inside, "."), fs::canonical(inside));
  for (const std::string& name : std::vector<std::string>{
           std::string(), std::string(".."), std::string("shelf/../.."), std::string("shelf/.."),
           std::string("/etc"), (folder_ / "outside").string(), std::string("link"),
           std::string("nothing"), std::string("file.txt"), std::string("shelf\0/x", 8)}) {
    EXPECT_EQ(CodeOf([&] { ResolveImportFolder(inside, name); }), "invalid_parameter") << name;
  }
  EXPECT_EQ(CodeOf([&] { ResolveImportFolder({}, "shelf"); }), "imports_off");
}

TEST_F(JobsTest, BackupsHaveSafeNames) {
  const Backups backups(folder_.path());
  Jobs jobs(*store_);
  for (const std::string& name : std::vector<std::string>{"../x.db", "/tmp/x.db", "x", ".db",
                                                          ".x.db", "a/b.db", "x.db\n", "ü.db"}) {
    EXPECT_EQ(CodeOf([&] { backups.Add(jobs, name); }), "invalid_parameter") << name;
    EXPECT_EQ(CodeOf([&] { backups.Get(name); }), "backup_not_found") << name;
  }
  EXPECT_EQ(CodeOf([&] { backups.Add(jobs, "x.db"); }), "backup_exists");
  EXPECT_EQ(CodeOf([&] { Backups("").List(); }), "backups_off");
  EXPECT_EQ(backups.List().size(), 1U);
  EXPECT_EQ(backups.Get("x.db").bytes, std::filesystem::file_size(database()));
}

TEST_F(JobsTest, BackupsSayNothingOfTheDirectory) {
  const std::filesystem::path directory = folder_ / "backups";
  std::filesystem::create_directory(directory);
  EngineOptions options;
  options.database = database();
  options.descriptor = "rootsift";
  Engine engine(options);
  const Backups backups(directory);
  Jobs jobs(*store_);
  backups.RegisterJob(jobs.runner(), engine);
  jobs.Start();
  std::filesystem::remove(directory);
  const std::string id = backups.Add(jobs, "a.db").id;
  ASSERT_TRUE(jobs.WaitFor(id, kPatience));
  const JobStatus job = jobs.Get(id);
  EXPECT_EQ(job.state, JobState::kFailed);
  ASSERT_TRUE(job.problem);
  EXPECT_EQ(job.problem->code, "internal") << "no space is another matter";
  EXPECT_THAT(job.problem->detail, ::testing::Not(::testing::HasSubstr(folder_.path().string())));
}

}  // namespace
}  // namespace pliant::server
