// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A store that cannot be written for a while, while others search.
#include <atomic>
#include <chrono>
#include <thread>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

TEST_F(ServerTest, AWriteThatWaitsKeepsNoCoreFromSearches) {
  Start({"--cores", "1", "--auto-train", "false"});
  auto client = server_->Client();
  const std::string first = std::string(kImages) + "/first";
  ASSERT_EQ(client.Put(first, TestImage(1), "image/png")->status, 201);
  SQLite::Database other((folder_.path() / "test.db").string(), SQLite::OPEN_READWRITE, 5000);
  other.exec("BEGIN IMMEDIATE");
  std::atomic<int> status = 0;
  std::thread writing([&] {
    auto writer = server_->Client();
    const auto answer =
        writer.Put(std::string(kImages) + "/second", TestImage(2, 0, 1500, 900), "image/png");
    status = answer ? answer->status : -1;
  });
  // The image is described, and then its write waits.
  for (const int cores : {1, 0}) {
    while (Metric(client, "pliant_busy_cores") != cores && status == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  // With the core taken this would wait until the write gives up.
  const auto thumbnail = client.Get(first + "/thumbnail");
  ASSERT_TRUE(thumbnail);
  EXPECT_EQ(thumbnail->status, 200);
  EXPECT_EQ(status, 0) << "nothing was waiting";
  other.exec("ROLLBACK");
  writing.join();
  EXPECT_EQ(status, 201);
}

}  // namespace
}  // namespace pliant::testing
