// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A server that may open no more files: it says that it is busy, names the reason in its log, and
// goes on as soon as it may again.
#include <chrono>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;

constexpr const char* kImages = "/v1/collections/default/images";

// From now on no file gets a number of `limit` or above.
void LimitOpenFiles(const ServerProcess& server, rlim_t limit) {
  rlimit limits{};
  ASSERT_EQ(::prlimit(server.id(), RLIMIT_NOFILE, nullptr, &limits), 0);
  limits.rlim_cur = std::min(limit, limits.rlim_max);
  ASSERT_EQ(::prlimit(server.id(), RLIMIT_NOFILE, &limits, nullptr), 0);
}

// The number that the next file would get.
rlim_t NextFile(const ServerProcess& server) {
  std::set<int> open;
  const auto folder = std::filesystem::path("/proc") / std::to_string(server.id()) / "fd";
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    open.insert(std::stoi(entry.path().filename().string()));
  }
  rlim_t next = 0;
  while (open.contains(static_cast<int>(next))) ++next;
  return next;
}

TEST(ServerFiles, WithoutFilesToOpenItIsBusyAndGoesOn) {
  const TemporaryFolder folder;
  const ServerProcess server(folder / "test.db",
                             {"--originals-dir", (folder / "originals").string()});
  auto client = server.Client();
  client.set_keep_alive(true);
  const auto put = [&](int number) {
    return client.Put(std::string(kImages) + "/p" + std::to_string(number) + "?object=o",
                      TestImage(static_cast<std::uint64_t>(number)), "image/png");
  };
  ASSERT_EQ(put(1)->status, 201);
  LimitOpenFiles(server, NextFile(server));
  const auto refused = put(2);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->status, 503) << refused->body;
  EXPECT_EQ(Json::parse(refused->body)["code"], "busy");
  EXPECT_TRUE(refused->has_header("Retry-After"));
  for (int i = 0; i < 200 && server.Log().find("too_many_open_files") == std::string::npos; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(25));  // it is written after the answer
  }
  EXPECT_THAT(server.Log(), HasSubstr("too_many_open_files"));
  const auto content = client.Get(std::string(kImages) + "/p1/content");
  ASSERT_TRUE(content);
  EXPECT_EQ(content->status, 503) << "not damaged: " << content->body;
  LimitOpenFiles(server, RLIM_INFINITY);
  EXPECT_EQ(put(2)->status, 201);
  EXPECT_EQ(client.Get(std::string(kImages) + "/p1/content")->status, 200);
}

}  // namespace
}  // namespace pliant::testing
