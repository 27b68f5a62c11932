// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A server with a directory for backups.
#pragma once

#include <algorithm>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/server_fixture.h"

namespace pliant::testing {

namespace fs = std::filesystem;

inline constexpr const char* kType = "application/octet-stream";

inline std::string Contents(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class BackupsTest : public ServerTest {
 protected:
  void SetUp() override { fs::create_directory(directory_); }

  void StartWithBackups(std::vector<std::string> flags = {}) {
    flags.insert(flags.begin(),
                 {"--auto-train", "false", "--max-body-mb", "1", "--backup-dir", directory_});
    Start(flags);
    client_ = std::make_unique<httplib::Client>("127.0.0.1", server_->port());
    client_->set_read_timeout(60);
  }

  // Makes one of `images` images, and gives its bytes.
  std::string MakeBackup(const std::string& name, int images = 2) {
    for (int i = 0; i < images; ++i) {
      const auto answer = Upload(*client_, TestImage(static_cast<std::uint64_t>(i), 0, 640, 480),
                                 "o" + std::to_string(i));
      EXPECT_LT(answer->status, 300) << answer->body;
    }
    const auto accepted =
        client_->Post("/v1/backups", Json{{"name", name}}.dump(), "application/json");
    EXPECT_EQ(accepted->status, 202) << accepted->body;
    const std::string job = "/v1/jobs/" + Json::parse(accepted->body)["id"].get<std::string>();
    EXPECT_EQ(Json::parse(client_->Get(job + "?wait=30")->body)["state"], "done");
    return Contents(fs::path(directory_) / name);
  }

  void Refused(const httplib::Result& answer, int status, const std::string& code,
               const std::string& words = "") {
    ASSERT_TRUE(answer) << httplib::to_string(answer.error());
    EXPECT_EQ(answer->status, status) << answer->body;
    const Json problem = Json::parse(answer->body);
    EXPECT_EQ(problem["code"], code) << problem;
    EXPECT_THAT(problem["detail"].get<std::string>(), ::testing::HasSubstr(words));
    EXPECT_THAT(answer->body, ::testing::Not(::testing::HasSubstr(folder_.path().string())));
  }

  std::vector<std::string> Files() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(directory_)) {
      names.push_back(entry.path().filename().string());
    }
    std::sort(names.begin(), names.end());
    return names;
  }

  const std::string directory_ = (folder_.path() / "backups").string();
  std::unique_ptr<httplib::Client> client_;
};

}  // namespace pliant::testing
