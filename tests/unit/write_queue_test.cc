// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/write_queue.h"

#include <atomic>
#include <chrono>
#include <filesystem>
#include <future>
#include <memory>
#include <stdexcept>
#include <thread>

#include <gtest/gtest.h>

#include "tests/unit/index_test_pictures.h"

namespace pliant {
namespace {

class WriteQueueTest : public ::testing::Test {
 protected:
  WriteQueueTest() {
    SQLite::Database(file_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
        .exec("CREATE TABLE t (n INTEGER)");
  }
  std::unique_ptr<Connection> Open() {
    return std::make_unique<Connection>(file_, Connection::Mode::kReadWrite, 100);
  }
  static void Insert(Connection& db) { db.Prepare("INSERT INTO t VALUES (1)").Run(); }

  testing::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "a.db";
};

// A writer that is blocked would hang the test: it gets a thread of its own and a time limit.
template <typename Work>
bool Finishes(Work work) {
  auto done = std::make_shared<std::promise<void>>();
  std::future<void> finished = done->get_future();
  std::thread([work, done] {
    work();
    done->set_value();
  }).detach();
  return finished.wait_for(std::chrono::seconds(20)) == std::future_status::ready;
}

TEST_F(WriteQueueTest, WhatIsThrownAfterTheCommitBlocksNobody) {
  // Lives on if the test fails.
  auto queue = std::make_shared<WriteQueue>(Open(), [] { throw 7; });  // no std::exception
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(Finishes([queue] {
      try {
        queue->Run(Insert);
      } catch (...) {
        ADD_FAILURE() << "the commit was durable, and is reported as such";
      }
    })) << i;
  }
  EXPECT_EQ(Open()->Scalar("SELECT count(*) FROM t"), 3);
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

}  // namespace
}  // namespace pliant
