// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <chrono>
#include <filesystem>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "index/store/sql/access.h"
#include "index/store/sqlite/sqlite_connection.h"
#include "tests/support/eventually.h"
#include "tests/unit/index_test_images.h"

namespace pliant {
namespace {

class WriteQueueTest : public ::testing::Test {
 protected:
  WriteQueueTest() {
    SQLite::Database(file_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
        .exec("CREATE TABLE t (n INTEGER)");
  }
  std::unique_ptr<Connection> Open() {
    return std::make_unique<SqliteConnection>(file_, SqliteConnection::Mode::kReadWrite, 100);
  }
  static void Insert(Connection& db) { db.Prepare("INSERT INTO t VALUES (1)").Run(); }

  testing::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "a.db";
};

// A writer that is blocked would hang the test: it gets a thread of its own and a time limit.
template <typename Work>
bool Finishes(const Work& work) {
  auto done = std::make_shared<std::promise<void>>();
  std::future<void> finished = done->get_future();
  std::thread([work, done] {
    work();
    done->set_value();
  }).detach();
  return finished.wait_for(std::chrono::seconds(20)) == std::future_status::ready;
}

// The commit was durable and is reported as such; then nothing is written until the index follows.
TEST_F(WriteQueueTest, WhatIsThrownAfterTheCommitStopsWriting) {
  auto fails = std::make_shared<bool>(true);
  // Lives on if the test fails.
  auto queue = std::make_shared<WriteQueue>(Open(), [fails] {
    if (*fails) throw std::runtime_error("the index is damaged");
  });
  ASSERT_TRUE(Finishes([queue] { EXPECT_NO_THROW(queue->Run(Insert)); }));
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(Finishes([queue] {
      try {
        queue->Run(Insert);
        ADD_FAILURE() << "written";
      } catch (const Error& error) {
        EXPECT_EQ(error.reason(), "writing_stopped");
        EXPECT_NE(std::string(error.what()).find("the index is damaged"), std::string::npos);
      }
    })) << i;
    EXPECT_EQ(Open()->Scalar("SELECT count(*) FROM t"), 1);
  }
  *fails = false;
  ASSERT_TRUE(Finishes([queue] { EXPECT_NO_THROW(queue->Run(Insert)); }));
  EXPECT_EQ(Open()->Scalar("SELECT count(*) FROM t"), 2);
}

TEST_F(WriteQueueTest, NothingThatIsThrownAfterTheCommitBlocks) {
  auto queue = std::make_shared<WriteQueue>(Open(), [] { throw 7; });  // no std::exception
  ASSERT_TRUE(Finishes([queue] { EXPECT_NO_THROW(queue->Run(Insert)); }));
  ASSERT_TRUE(Finishes([queue] { EXPECT_THROW(queue->Run(Insert), Error); }));
  EXPECT_EQ(Open()->Scalar("SELECT count(*) FROM t"), 1);
}

TEST_F(WriteQueueTest, WhatWorkThrowsUndoesItAloneAndIsThrownToItsCaller) {
  WriteQueue queue(Open(), [] {});
  EXPECT_THROW(queue.Run([](Connection& db) {
    Insert(db);
    throw std::runtime_error("no");
  }),
               std::runtime_error);
  EXPECT_THROW(queue.Run([](Connection&) { throw 7; }), int);
  queue.Run(Insert);
  EXPECT_EQ(Open()->Scalar("SELECT count(*) FROM t"), 1);
}

// Work with effects outside the database must not see what could still be undone.
TEST_F(WriteQueueTest, WhatRunsAloneSeesOnlyWhatIsCommitted) {
  WriteQueue queue(Open(), [] {});
  std::promise<void> go;
  std::shared_future<void> gate = go.get_future().share();
  std::atomic<int> begun{0};
  std::vector<std::jthread> threads;
  threads.emplace_back([&] {  // holds the queue until all others wait in it
    queue.Run([&](Connection&) {
      ++begun;
      gate.wait();
    });
  });
  while (begun == 0) std::this_thread::yield();
  std::atomic<int> uncommitted{0};
  std::atomic<int> alone{0};
  for (int i = 0; i < 12; ++i) {
    std::promise<pid_t> id;
    threads.emplace_back([&, i] {
      id.set_value(gettid());
      if (i % 3 != 1) return queue.Run(Insert);
      queue.Run(
          [&](Connection& db) {
            const std::int64_t here = db.Scalar("SELECT count(*) FROM t");
            if (here != Open()->Scalar("SELECT count(*) FROM t")) ++uncommitted;
            ++alone;
          },
          {.alone = true});
    });
    const std::string waiting = "/proc/self/task/" + std::to_string(id.get_future().get());
    EXPECT_TRUE(testing::Eventually([&] { return testing::StateOf(waiting) == 'S'; }));
  }
  go.set_value();
  threads.clear();
  EXPECT_EQ(alone, 4);
  EXPECT_EQ(uncommitted, 0);
  EXPECT_EQ(Open()->Scalar("SELECT count(*) FROM t"), 8);
}

}  // namespace
}  // namespace pliant
