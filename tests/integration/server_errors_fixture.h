// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A server that the error tests share, and what an answer must say of an error.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {

inline constexpr const char* kImages = "/v1/collections/default/images";
inline constexpr const char* kSearch = "/v1/collections/default/search";
inline constexpr const char* kVocabularies = "/v1/collections/default/vocabularies";
inline const std::string kPng = "image/png";
inline const std::string kJson = "application/json";

struct ErrorCase {
  std::string method, path, body, type;
  int status;
  std::string code, parameter = {};
};

// Shared by the cases: none of them changes anything.
class ServerErrorsTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    server_ = std::make_unique<ServerProcess>(
        folder_->path() / "test.db",
        std::vector<std::string>{"--auto-train", "false", "--max-body-mb", "1", "--header-timeout",
                                 "1", "--body-timeout", "1", "--max-header-kb", "16",
                                 "--max-megapixels", "2"});
    image_ = TestImage(1);
    auto client = server_->Client();
    ASSERT_EQ(client.Put(std::string(kImages) + "/one?object=o", image_, "image/png")->status, 201);
  }
  static void TearDownTestSuite() {
    server_.reset();
    folder_.reset();
  }

  static void ExpectProblem(const httplib::Response& answer, int status, const std::string& code,
                            const std::string& parameter = "") {
    EXPECT_EQ(answer.status, status) << answer.body;
    EXPECT_EQ(answer.get_header_value("Content-Type"), "application/problem+json");
    const Json problem = Json::parse(answer.body, nullptr, false);
    ASSERT_TRUE(problem.is_object()) << answer.body;
    EXPECT_EQ(problem["status"], status);
    EXPECT_EQ(problem["code"], code) << answer.body;
    EXPECT_EQ(problem.value("parameter", ""), parameter) << answer.body;
    EXPECT_FALSE(problem["title"].get<std::string>().empty());
    EXPECT_FALSE(problem["detail"].get<std::string>().empty());
    EXPECT_EQ(problem["request_id"], answer.get_header_value("X-Request-Id"));
    EXPECT_FALSE(answer.get_header_value("X-Request-Id").empty());
  }

  static void ExpectProblems(const std::vector<ErrorCase>& cases) {
    auto client = server_->Client();
    for (const ErrorCase& wrong : cases) {
      SCOPED_TRACE(wrong.method + " " + wrong.path.substr(0, 80) + " " + wrong.type + " " +
                   wrong.body.substr(0, 60));
      const auto answer = Send(client, wrong);
      ASSERT_TRUE(answer) << httplib::to_string(answer.error());
      ExpectProblem(*answer, wrong.status, wrong.code, wrong.parameter);
    }
    ExpectAlive();
  }

  static void ExpectAlive() {
    auto client = server_->Client();
    const auto answer = client.Put(std::string(kImages) + "/one?object=o", image_, "image/png");
    ASSERT_TRUE(answer) << server_->Log();
    EXPECT_EQ(answer->status, 200) << answer->body;
  }

  inline static std::unique_ptr<TemporaryFolder> folder_;
  inline static std::unique_ptr<ServerProcess> server_;
  inline static std::string image_;
};

}  // namespace pliant::testing
