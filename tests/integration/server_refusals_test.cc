// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Every operation of the OpenAPI document refuses what is wrong with the status and code that the
// document gives for it. The table is made of the document, and checked for gaps: a new route
// cannot be forgotten.
#include <algorithm>
#include <iostream>
#include <map>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/json_schema.h"
#include "tests/integration/openapi_fixture.h"
#include "tests/integration/wrong_requests.h"

namespace pliant::testing {
namespace {

using ::testing::Contains;
using ::testing::IsEmpty;

class RefusalsTest : public OpenApiTest {
 protected:
  static void ExpectProblem(const httplib::Result& answer, const Wrong& wrong) {
    ASSERT_TRUE(answer) << httplib::to_string(answer.error());
    EXPECT_EQ(answer->status, wrong.status) << answer->body;
    EXPECT_EQ(answer->get_header_value("Content-Type"), "application/problem+json");
    const Json problem = Json::parse(answer->body, nullptr, false);
    ASSERT_TRUE(problem.is_object()) << answer->body;
    EXPECT_EQ(problem["code"], wrong.code) << answer->body;
    EXPECT_EQ(problem["request_id"], answer->get_header_value("X-Request-Id"));
    EXPECT_THAT(
        SchemaDifferences(document_, document_["components"]["schemas"]["Problem"], problem),
        IsEmpty());
  }
};

TEST_F(RefusalsTest, WhatIsWrongIsAnsweredWithADocumentedCode) {
  auto client = server_->Client();
  std::map<std::string, int> sent;
  for (const Operation& operation : Operations()) {
    PrepareState();
    const WrongRequests wrongs(operation, Filled(operation.path), Filled);
    std::set<std::string> kinds;
    for (const Wrong& wrong : wrongs.all()) {
      if (wrong.code.empty()) continue;
      SCOPED_TRACE(operation.method + " " + operation.path + ": " + wrong.kind + ", " + wrong.what);
      ExpectProblem(Send(client, wrong), wrong);
      EXPECT_TRUE(Documents(operation, wrong.status, wrong.code)) << "it is not documented";
      kinds.insert(wrong.kind);
      ++sent[wrong.kind];
    }
    for (const std::string& kind : wrongs.MustHave()) {
      EXPECT_THAT(kinds, Contains(kind)) << operation.method << " " << operation.path;
    }
  }
  for (const auto& [kind, count] : sent) std::cout << kind << ": " << count << " requests\n";
  EXPECT_GT(sent["unknown id"], 15);
  EXPECT_EQ(Json::parse(client.Get("/v1/collections/default")->body)["images"], 1)
      << "nothing that was refused left anything";
}

TEST_F(RefusalsTest, OtherMethodsAreNotAllowed) {
  auto client = server_->Client();
  for (const auto& [path, methods] : document_["paths"].items()) {
    std::set<std::string> allowed;
    for (const auto& [method, operation] : methods.items()) {
      std::string upper = method;
      for (char& c : upper) c = static_cast<char>(std::toupper(c));
      allowed.insert(upper);
      if (upper == "GET") allowed.insert("HEAD");
    }
    std::string allow;
    for (const std::string& method : allowed) allow += (allow.empty() ? "" : ", ") + method;
    for (const char* method : {"GET", "POST", "PUT", "DELETE", "PATCH", "OPTIONS"}) {
      if (allowed.contains(method)) continue;
      SCOPED_TRACE(method + (" " + path));
      const Wrong wrong = {"", "", method, Filled(path), "", "", 405, "method_not_allowed"};
      const auto answer = Send(client, wrong);
      ExpectProblem(answer, wrong);
      EXPECT_EQ(answer->get_header_value("Allow"), allow);
    }
  }
}

TEST_F(RefusalsTest, KeysOpenWhatTheirScopeSaysAndNothingElse) {
  const std::filesystem::path database = folder_->path() / "keys.db";
  std::map<std::string, std::string> keys;
  for (const std::string scope : {"read", "write", "admin"}) {
    const ProgramResult made = Program({"keys", "create", "--name", scope, "--scope", scope, "--db",
                                        database.string(), "--descriptor", "rootsift"},
                                       {}, ServerPath())
                                   .Wait();
    ASSERT_EQ(made.status, 0) << made.err;
    keys[scope] = made.out.substr(0, made.out.find('\n'));
  }
  const ServerProcess server(database, {"--auto-train", "false"});
  auto client = server.Client();
  const std::vector<std::string> scopes = {"public", "read", "write", "admin"};
  const auto rank = [&](const std::string& scope) {
    return std::find(scopes.begin(), scopes.end(), scope) - scopes.begin();
  };
  for (const Operation& operation : Operations()) {
    SCOPED_TRACE(operation.method + " " + operation.path);
    const std::string needed = operation.json["x-scope"];
    Wrong request = {"", "", operation.method, Filled(operation.path), "", "", 401, "unauthorized"};
    client.set_default_headers({});
    const auto without = Send(client, request);
    ASSERT_TRUE(without);
    if (operation.IsPublic()) {
      EXPECT_LT(without->status, 400) << without->body;
      continue;
    }
    ExpectProblem(without, request);
    EXPECT_THAT(without->get_header_value("WWW-Authenticate"), ::testing::StartsWith("Bearer"));
    EXPECT_TRUE(Documents(operation, 401, "unauthorized"));
    EXPECT_TRUE(Documents(operation, 403, "forbidden"));
    client.set_default_headers({{"Authorization", "Bearer " + keys["read"] + "x"}});
    ExpectProblem(Send(client, request), request);
    request.status = 403;
    request.code = "forbidden";
    for (const auto& [scope, key] : keys) {
      client.set_default_headers({{"Authorization", "Bearer " + key}});
      const auto with = Send(client, request);
      ASSERT_TRUE(with);
      if (rank(scope) < rank(needed)) {
        ExpectProblem(with, request);
      } else {
        EXPECT_NE(with->status, 401) << scope << with->body;
        EXPECT_THAT(with->body, ::testing::Not(::testing::HasSubstr("\"code\":\"forbidden\"")))
            << scope;
      }
    }
  }
}

}  // namespace
}  // namespace pliant::testing
