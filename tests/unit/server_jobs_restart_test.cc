// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Jobs over restarts of the server: stopped, killed, cancelled.
#include <future>
#include <map>

#include "tests/unit/jobs_fixture.h"

namespace pliant::server {
namespace {

TEST_F(JobsTest, GoOnAfterARestart) {
  std::string running;
  std::string queued;
  {
    Jobs jobs(*store_);
    jobs.Register("wait", Kind(UntilStopped));
    jobs.Start();
    running = jobs.Add("wait", "a", Json::object()).id;
    queued = jobs.Add("wait", "b", Json::object()).id;
    while (jobs.Get(running).state != JobState::kRunning) {
      std::this_thread::sleep_for(milliseconds(1));
    }
  }  // the server is stopped, nobody has cancelled anything
  std::vector<std::string> order;
  Jobs jobs(*store_);
  jobs.Register("wait", Kind([&](const JobStatus& job, const JobContext&) {
                  order.push_back(job.collection);
                  return std::string("/done");
                }));
  jobs.Start();
  EXPECT_TRUE(jobs.WaitFor(running, kPatience));
  EXPECT_TRUE(jobs.WaitFor(queued, kPatience));
  EXPECT_EQ(order, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(jobs.Get(running).state, JobState::kDone);
  EXPECT_EQ(jobs.Get(running).attempts, 1) << "an orderly stop is no failed attempt";
}

// kill -9 between the answer to a cancellation and the end of the job.
TEST_F(JobsTest, AreNotBegunAgainAfterTheyWereCancelled) {
  std::promise<void> told, let_go;
  Jobs jobs(*store_);
  jobs.Register("wait", Kind([&](const JobStatus&, const JobContext& context) {
                  while (!context.stop.stop_requested()) {
                    std::this_thread::sleep_for(milliseconds(1));
                  }
                  context.progress(1, 2);
                  told.set_value();
                  let_go.get_future().wait();  // it does not end at once
                  return std::string("/done");
                }));
  jobs.Start();
  const std::string id = jobs.Add("wait", "a", Json::object()).id;
  while (jobs.Get(id).state != JobState::kRunning) std::this_thread::sleep_for(milliseconds(1));
  EXPECT_EQ(jobs.Cancel(id).state, JobState::kRunning);
  told.get_future().wait();
  {
    Jobs later(*store_);  // what the next start of the server finds
    later.Register("wait", Kind([](const JobStatus&, const JobContext&) -> std::string {
                     ADD_FAILURE() << "it was cancelled";
                     return "/done";
                   }));
    later.Start();
    EXPECT_TRUE(later.WaitFor(id, kPatience));
    EXPECT_EQ(later.Get(id).state, JobState::kCancelled);
    EXPECT_NE(later.Get(id).finished_ms, 0);
    EXPECT_FALSE(later.Get(id).problem);
  }
  let_go.set_value();
  EXPECT_TRUE(jobs.WaitFor(id, kPatience));
  EXPECT_EQ(jobs.Get(id).state, JobState::kDone) << "too late to end it";
}

TEST_F(JobsTest, BeginAgainWhenTheDatabaseWasAway) {
  std::map<std::string, int> begun;
  const auto work = [&begun](const JobStatus& job, const JobContext&) -> std::string {
    if (++begun[job.kind] == 1 || job.kind != "once") {
      throw Error(ErrorCode::kUnavailable, "database_unavailable", "gone");
    }
    return "/done";
  };
  Jobs jobs(*store_);
  jobs.Register("once", Kind(work));
  jobs.Register("always", Kind(work));
  jobs.Register("no more", Kind(work, /*resumes=*/false));
  jobs.Start();
  const auto ended = [&](const std::string& kind) {
    const std::string id = jobs.Add(kind, "a", Json::object()).id;
    EXPECT_TRUE(jobs.WaitFor(id, kPatience)) << kind;
    return jobs.Get(id);
  };
  EXPECT_EQ(ended("once").state, JobState::kDone);
  EXPECT_EQ(begun["once"], 2);
  const JobStatus always = ended("always");
  EXPECT_EQ(always.state, JobState::kFailed);
  EXPECT_EQ(always.attempts, JobRunner::kMaxAttempts);
  EXPECT_EQ(always.problem->code, "database_unavailable");
  EXPECT_EQ(ended("no more").state, JobState::kFailed);
  EXPECT_EQ(begun["no more"], 1);
}

// What a killed server leaves: "running".
TEST_F(JobsTest, AreMarkedAsFailedWhereTheyCannotGoOn) {
  const auto leave = [&](const std::string& id, const std::string& kind, int attempts) {
    JobRecord record;
    record.id = id;
    record.kind = kind;
    record.state = "running";
    record.attempts = attempts;
    record.created_ms = 1;
    store_->SaveJob(record);
  };
  leave("once", "again", 1);
  leave("thrice", "again", JobRunner::kMaxAttempts);
  leave("backup", "never", 1);
  leave("gone", "a kind of a newer version", 1);
  Jobs jobs(*store_);
  const auto succeed = [](const JobStatus&, const JobContext&) { return std::string("/done"); };
  jobs.Register("again", Kind(succeed));
  jobs.Register("never", Kind(succeed, false));
  jobs.Start();
  EXPECT_TRUE(jobs.WaitFor("once", kPatience));
  EXPECT_EQ(jobs.Get("once").state, JobState::kDone);
  EXPECT_EQ(jobs.Get("once").attempts, 2);
  for (const char* id : {"thrice", "backup", "gone"}) {
    EXPECT_EQ(jobs.Get(id).state, JobState::kFailed) << id;
    ASSERT_TRUE(jobs.Get(id).problem) << id;
    EXPECT_EQ(jobs.Get(id).problem->code, "interrupted") << id;
  }
}

}  // namespace
}  // namespace pliant::server
