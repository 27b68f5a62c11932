// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Several servers on one database: whose a job is, who takes it over, who may end it.
#include <atomic>
#include <csignal>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "index/files/process_lock.h"
#include "tests/unit/jobs_fixture.h"

namespace pliant::server {
namespace {

// What a server is to the jobs of a database.
class Server {
 public:
  explicit Server(const std::filesystem::path& database)
      : store_(OpenServiceStore(database)), jobs_(std::make_unique<Jobs>(*store_)) {
    jobs_->Register("wait", {[this](const JobStatus&, const JobContext& context) {
                               ++begun_;
                               while (!context.stop.stop_requested() && !done_) {
                                 context.progress(1, 4);
                                 std::this_thread::sleep_for(milliseconds(1));
                               }
                               if (done_) return std::string("/done");
                               throw Error(ErrorCode::kCancelled, "cancelled", "stopped");
                             },
                             true});
    jobs_->Start();
  }
  ~Server() { Stop(); }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  void Stop() {
    jobs_.reset();
    store_.reset();
  }
  void Finish() { done_ = true; }
  Jobs& jobs() { return *jobs_; }
  ServiceStore& store() { return *store_; }
  int begun() const { return begun_; }

 private:
  std::atomic<int> begun_{0};
  std::atomic<bool> done_{false};
  std::unique_ptr<ServiceStore> store_;
  std::unique_ptr<Jobs> jobs_;
};

class JobOwnersTest : public JobsTest {
 protected:
  std::size_t Locks() const {
    std::size_t count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      count += entry.path().filename().string().starts_with("x.db.server-") ? 1 : 0;
    }
    return count;
  }
};

TEST_F(JobOwnersTest, ASecondServerLeavesARunningJobAlone) {
  Server first(database());
  const std::string id = first.jobs().Add("wait", "default", Json::object()).id;
  ASSERT_TRUE(Eventually([&] { return first.jobs().Get(id).state == JobState::kRunning; }));
  ASSERT_TRUE(Eventually([&] { return first.store().Jobs().at(0).state == "running"; }));
  Server second(database());
  EXPECT_EQ(second.jobs().Get(id).state, JobState::kRunning);
  EXPECT_TRUE(second.jobs().Active("wait", "default")) << "it trains no vocabulary twice";
  std::this_thread::sleep_for(2 * JobRunner::kPollEvery);
  EXPECT_EQ(second.begun(), 0);
  first.Finish();
  EXPECT_TRUE(second.jobs().WaitFor(id, kPatience)) << "the other's end is seen";
  EXPECT_EQ(second.jobs().Get(id).state, JobState::kDone);
  EXPECT_EQ(second.jobs().Get(id).result, "/done");
  EXPECT_EQ(first.begun(), 1);
  EXPECT_EQ(second.begun(), 0);
}

TEST_F(JobOwnersTest, AJobIsFoundAtOnceWhereItWasNotMade) {
  Server first(database());
  Server second(database());
  const std::string id = first.jobs().Add("wait", "default", Json::object()).id;
  EXPECT_EQ(second.jobs().Get(id).id, id);
}

TEST_F(JobOwnersTest, OfServersAtOnceOneAddsTheOnlyJob) {
  std::vector<std::unique_ptr<Server>> servers;
  for (int i = 0; i < 4; ++i) servers.push_back(std::make_unique<Server>(database()));
  std::atomic<int> added{0};
  std::vector<std::thread> threads;
  for (const auto& server : servers) {
    threads.emplace_back([&added, jobs = &server->jobs()] {
      for (int i = 0; i < 5; ++i) {
        added += jobs->AddOnly("wait", "default", Json::object()).has_value() ? 1 : 0;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(added, 1);
  EXPECT_EQ(servers[0]->store().Jobs().size(), 1U);
  EXPECT_TRUE(servers[0]->jobs().AddOnly("wait", "other", Json::object())) << "of a collection";
  for (const auto& server : servers) server->Finish();
  const std::string id = servers[0]->store().Jobs().at(0).id;
  ASSERT_TRUE(Eventually([&] { return servers[0]->store().Jobs().at(0).state == "done"; }));
  ASSERT_TRUE(Eventually([&] { return servers[0]->jobs().Get(id).state == JobState::kDone; }));
  EXPECT_TRUE(servers[0]->jobs().AddOnly("wait", "default", Json::object())) << "it has ended";
}

TEST_F(JobOwnersTest, WhatAServerLeavesGoesToOneOther) {
  auto first = std::make_unique<Server>(database());
  const std::string running = first->jobs().Add("wait", "a", Json::object()).id;
  const std::string queued = first->jobs().Add("wait", "b", Json::object()).id;
  ASSERT_TRUE(Eventually([&] { return first->begun() == 1; }));
  Server second(database());
  Server third(database());
  first.reset();
  ASSERT_TRUE(Eventually([&] { return second.begun() + third.begun() >= 1; }));
  second.Finish();
  third.Finish();
  for (const std::string& id : {running, queued}) {
    EXPECT_TRUE(second.jobs().WaitFor(id, kPatience));
    EXPECT_TRUE(third.jobs().WaitFor(id, kPatience));
    EXPECT_EQ(second.jobs().Get(id).state, JobState::kDone);
    EXPECT_EQ(third.jobs().Get(id).state, JobState::kDone);
  }
  EXPECT_EQ(second.begun() + third.begun(), 2) << "each of the two once";
}

TEST_F(JobOwnersTest, AKilledServersJobIsTakenOver) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    Server killed(database());
    killed.jobs().Add("wait", "default", Json::object());
    while (true) pause();
  }
  const auto store = OpenServiceStore(database());
  const bool began = Eventually([&] {
    const auto jobs = store->Jobs();
    return !jobs.empty() && jobs[0].state == "running";
  });
  EXPECT_TRUE(began);
  Server other(database());
  EXPECT_EQ(other.begun(), 0);
  kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(Eventually([&] { return other.begun() == 1; })) << "without a restart";
  EXPECT_EQ(other.jobs().List().at(0).attempts, 2);
  EXPECT_EQ(Locks(), 2U);
  Server later(database());
  EXPECT_EQ(Locks(), 2U) << "the killed one's is removed";
}

TEST_F(JobOwnersTest, AnyServerMayEndAJob) {
  Server first(database());
  Server second(database());
  const std::string running = first.jobs().Add("wait", "a", Json::object()).id;
  const std::string queued = first.jobs().Add("wait", "b", Json::object()).id;
  second.jobs().Cancel(queued);
  second.jobs().Cancel(running);
  for (const std::string& id : {running, queued}) {
    EXPECT_TRUE(first.jobs().WaitFor(id, kPatience));
    EXPECT_EQ(first.jobs().Get(id).state, JobState::kCancelled);
    EXPECT_TRUE(second.jobs().WaitFor(id, kPatience));
    EXPECT_EQ(second.jobs().Get(id).state, JobState::kCancelled);
  }
  EXPECT_EQ(second.jobs().Cancel(running).state, JobState::kCancelled) << "no effect";
}

// The server that was asked to end a job is killed before it has: that was acknowledged.
TEST_F(JobOwnersTest, AnEndThatWasAskedForSurvivesAKill) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const auto store = OpenServiceStore(database());
    Jobs deaf(*store);
    deaf.Register("wait", {[](const JobStatus&, const JobContext&) -> std::string {
                             while (true) pause();
                           },
                           true});
    deaf.Start();
    const std::string id = deaf.Add("wait", "default", Json::object()).id;
    while (deaf.Get(id).state != JobState::kRunning) std::this_thread::yield();
    deaf.Cancel(id);
    std::ofstream(folder_.path() / "cancelled") << id;
    while (true) pause();
  }
  EXPECT_TRUE(Eventually([&] { return std::filesystem::exists(folder_.path() / "cancelled"); }));
  kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  Server later(database());
  const JobStatus job = later.jobs().List().at(0);
  EXPECT_EQ(job.state, JobState::kCancelled);
  EXPECT_EQ(later.begun(), 0);
}

// Somebody removed the file by which the others see that a server lives.
TEST_F(JobOwnersTest, WhoLosesAJobEndsItAndWritesNoMore) {
  Server first(database());
  const std::string id = first.jobs().Add("wait", "default", Json::object()).id;
  ASSERT_TRUE(Eventually([&] { return first.begun() == 1; }));
  std::filesystem::remove(database().string() + ".server-" + first.store().Owner());
  Server second(database());
  ASSERT_TRUE(Eventually([&] { return second.begun() == 1; }));
  second.Finish();
  EXPECT_TRUE(second.jobs().WaitFor(id, kPatience));
  EXPECT_TRUE(Eventually([&] { return first.jobs().Get(id).state == JobState::kDone; }));
  first.Stop();
  EXPECT_EQ(second.store().Jobs().at(0).state, "done");
}

TEST_F(JobOwnersTest, OwnersOfForeignDatabasesAreNoPaths) {
  const std::string dead = "12-0123456789abcdef";
  const std::string copy = "13-0123456789abcdef";
  std::ofstream(database().string() + ".server-" + dead) << "";
  std::ofstream(database().string() + ".server-" + copy) << "somebody's";
  std::ofstream(database().string() + ".server-2") << "";
  const ProcessLock lock(database());
  EXPECT_EQ(Locks(), 3U) << "what a dead process left is removed, and nothing else";
  EXPECT_FALSE(std::filesystem::exists(database().string() + ".server-" + dead));
  EXPECT_TRUE(lock.IsHeld(lock.id()));
  for (const std::string& id : {dead, copy, std::string("2"), std::string(), std::string("../x.db"),
                                std::string(99, '0')}) {
    EXPECT_FALSE(lock.IsHeld(id)) << id;
  }
}

TEST_F(JobOwnersTest, LinksLeadToOneDatabase) {
  std::filesystem::create_directory(folder_.path() / "elsewhere");
  const std::filesystem::path link = folder_.path() / "elsewhere" / "link.db";
  std::filesystem::create_symlink(database(), link);
  const ProcessLock one(database());
  const ProcessLock other(link);
  EXPECT_TRUE(other.IsHeld(one.id()));
  EXPECT_TRUE(one.IsHeld(other.id()));
}

// Somebody removed the locks of both, or renamed their directory: then neither knows.
TEST_F(JobOwnersTest, WhoCannotKnowTakesNothing) {
  const ProcessLock one(database());
  const ProcessLock other(database());
  std::filesystem::remove(database().string() + ".server-" + one.id());
  EXPECT_FALSE(other.IsHeld(one.id()));
  std::filesystem::remove(database().string() + ".server-" + other.id());
  EXPECT_TRUE(other.IsHeld(one.id()));
}

}  // namespace
}  // namespace pliant::server
