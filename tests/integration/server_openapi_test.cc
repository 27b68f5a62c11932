// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The examples of the OpenAPI document run and are answered in the documented form.
#include <cstdio>
#include <fstream>
#include <optional>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/json_schema.h"
#include "tests/integration/openapi_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::IsEmpty;

class ExamplesTest : public OpenApiTest {
 protected:
  static ProgramResult Keys(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "keys");
    arguments.insert(arguments.end(), {"--db", (folder_->path() / "test.db").string()});
    return Program(arguments, {}, ServerPath()).Wait();
  }

  // A server that has keys answers nobody without one: only the routes about keys meet any.
  struct WithKeys {
    WithKeys() {
      Keys({"create", "--name", "other"});
      const ProgramResult made = Keys({"create", "--name", "admin", "--scope", "admin", "--json"});
      admin = made.json()["key"];
      id = Keys({"list", "--json"}).json()["keys"][0]["id"];
    }
    ~WithKeys() {
      const Json list = Keys({"list", "--json"}).json();
      for (const Json& key : list["keys"]) Keys({"revoke", key["id"]});
      Keys({"purge"});
    }
    std::string admin, id;
  };

  // Runs `example` in the folder of the images; the status, and the body in `body`.
  static int RunExample(const std::string& example, std::string* body) {
    std::optional<WithKeys> keys;
    if (example.find("$ADMIN_KEY") != std::string::npos) keys.emplace();
    const std::string script =
        "cd '" + folder_->path().string() +
        "' && PLIANT=http://127.0.0.1:" + std::to_string(server_->port()) +
        " IMAGE=mug-1 JOB=" + job_ + " VOCABULARY=" + vocabulary_ + " BACKUP=first.db" +
        (keys ? " ADMIN_KEY=" + keys->admin + " KEY_ID=" + keys->id : "") +
        " && curl() { command curl -sS -o answer -w '%{http_code}' \"$@\"; } && rm -f answer && " +
        example;
    FILE* pipe = popen(script.c_str(), "r");
    std::string status;
    for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) status += static_cast<char>(c);
    EXPECT_EQ(pclose(pipe), 0) << example;
    std::ifstream file(folder_->path() / "answer", std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    *body = text.str();
    return std::atoi(status.c_str());
  }
};

TEST_F(ExamplesTest, ExamplesRunAndAreAnsweredAsDocumented) {
  int run = 0;
  for (const Operation& operation : Operations()) {
    SCOPED_TRACE(operation.method + " " + operation.path);
    if (operation.path == "/") continue;  // the page
    ASSERT_TRUE(operation.json.contains("x-codeSamples")) << "there is no example";
    PrepareState();
    const std::string example = operation.json["x-codeSamples"][0]["source"];
    std::string body;
    const int status = RunExample(example, &body);
    EXPECT_GE(status, 200) << example;
    EXPECT_LT(status, 300) << example << "\n" << body;
    const Json response = operation.json["responses"].value(std::to_string(status), Json::object());
    ASSERT_FALSE(response.empty()) << status << " is not documented";
    if (!response.contains("content")) {
      EXPECT_THAT(body, IsEmpty());
    } else if (response["content"].contains("application/json")) {
      const Json schema = response["content"]["application/json"].value("schema", Json::object());
      EXPECT_THAT(SchemaDifferences(document_, schema, Json::parse(body)), IsEmpty()) << body;
    } else {
      EXPECT_FALSE(body.empty());
    }
    ++run;
  }
  EXPECT_GT(run, 25);
}

}  // namespace
}  // namespace pliant::testing
