// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The OpenAPI document is true: its examples run and are answered in the documented form, and every
// operation answers what is wrong with the codes that the document gives for it.
#include <cstdio>
#include <fstream>
#include <sstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/json_schema.h"
#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

using ::testing::IsEmpty;

struct Operation {
  std::string path, method;  // as in the document
  Json json;

  bool Takes(const std::string& media_type) const {
    return json.contains("requestBody") && json["requestBody"]["content"].contains(media_type);
  }
  bool IsPublic() const { return json["x-scope"] == "public"; }
};

// The answers to a request that shall be refused.
struct Wrong {
  std::string what, method, path, body, type;
  int status;
  std::string code;
};

class OpenApiTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    std::filesystem::create_directories(folder_->path() / "backups");
    // As few restrictions as an example may meet.
    server_ = std::make_unique<ServerProcess>(
        folder_->path() / "test.db",
        std::vector<std::string>{"--auto-train", "false", "--max-body-mb", "1", "--backup-dir",
                                 (folder_->path() / "backups").string(), "--import-dir",
                                 folder_->path().string()});
    Save("mug.png", TestPicture(1));
    Save("cup.png", TestPicture(2));
    std::filesystem::create_directories(folder_->path() / "shelf");
    Save("shelf/plate.png", TestPicture(3));
    auto client = server_->Client();
    document_ = Json::parse(client.Get("/v1/openapi.json")->body);
    PrepareState();
    const auto accepted =
        client.Post("/v1/collections/default/vocabularies", R"({"words": 20})", "application/json");
    job_ = Json::parse(accepted->body)["id"];
    while (Json::parse(client.Get("/v1/jobs/" + job_)->body)["finished_at"].is_null()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    const Json list = Json::parse(client.Get("/v1/collections/default/vocabularies")->body);
    vocabulary_ = list["vocabularies"].back()["id"].dump();
    client.Post("/v1/backups", R"({"name": "first.db"})", "application/json");
    while (client.Get("/v1/backups/first.db")->status != 200) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  static void TearDownTestSuite() {
    server_.reset();
    folder_.reset();
  }

  static void Save(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_->path() / name, std::ios::binary) << bytes;
  }

  // What the examples are about; an earlier one may have deleted it.
  static void PrepareState() {
    auto client = server_->Client();
    ASSERT_TRUE(client.Put("/v1/collections/toys"));
    const auto mug =
        client.Put("/v1/collections/default/images/mug-1?object=mug", TestPicture(1), "image/png");
    ASSERT_LT(mug->status, 300) << mug->body;
  }

  static std::vector<Operation> Operations() {
    std::vector<Operation> operations;
    for (const auto& [path, methods] : document_["paths"].items()) {
      for (const auto& [method, json] : methods.items()) {
        std::string upper = method;
        for (char& c : upper) c = static_cast<char>(std::toupper(c));
        operations.push_back({path, upper, json});
      }
    }
    return operations;
  }

  // Runs `example` in the folder of the pictures; the status, and the body in `body`.
  static int RunExample(const std::string& example, std::string* body) {
    const std::string script =
        "cd '" + folder_->path().string() +
        "' && PLIANT=http://127.0.0.1:" + std::to_string(server_->port()) +
        " IMAGE=mug-1 JOB=" + job_ + " VOCABULARY=" + vocabulary_ + " BACKUP=first.db" +
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

  static std::string Filled(std::string path) {
    const std::pair<std::string, std::string> values[] = {
        {"{c}", "default"},   {"{o}", "mug"},
        {"{v}", vocabulary_}, {"{b}", "first.db"},
        {"{n}", "0"},         {"{id}", path.starts_with("/v1/jobs") ? job_ : "mug-1"}};
    for (const auto& [name, value] : values) {
      const std::size_t at = path.find(name);
      if (at != std::string::npos) path.replace(at, name.size(), value);
    }
    return path;
  }

  static httplib::Result Send(httplib::Client& client, const Wrong& wrong) {
    httplib::Request request;
    request.method = wrong.method;
    request.path = wrong.path;
    request.body = wrong.body;
    if (!wrong.type.empty()) request.set_header("Content-Type", wrong.type);
    return client.send(request);
  }

  static bool Documents(const Operation& operation, int status, const std::string& code) {
    const Json response = operation.json["responses"].value(std::to_string(status), Json());
    if (response.is_null()) return false;
    const Json& parts = response["content"]["application/problem+json"]["schema"]["allOf"];
    const Json& codes = parts[1]["properties"]["code"]["enum"];
    return std::find(codes.begin(), codes.end(), code) != codes.end();
  }

  static std::vector<Wrong> WrongRequests(const Operation& operation);

  inline static std::unique_ptr<TemporaryFolder> folder_;
  inline static std::unique_ptr<ServerProcess> server_;
  inline static Json document_;
  inline static std::string job_;
  inline static std::string vocabulary_;
};

TEST_F(OpenApiTest, ExamplesRunAndAreAnsweredAsDocumented) {
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

std::vector<Wrong> OpenApiTest::WrongRequests(const Operation& operation) {
  std::vector<Wrong> wrong;
  const std::string path = Filled(operation.path);
  const auto add = [&](const std::string& what, const std::string& at, const std::string& body,
                       const std::string& type, int status, const std::string& code) {
    wrong.push_back({what, operation.method, at, body, type, status, code});
  };
  const std::string picture = TestPicture(1);
  const bool image = operation.Takes("image/*");
  const bool json = operation.Takes("application/json");
  const bool form_only = operation.Takes("multipart/form-data") && !image;
  const std::string type = image ? "image/png" : json ? "application/json" : "";
  const bool imports = operation.path.ends_with("/imports");
  const std::string body = image ? picture : imports ? R"({"folder": "shelf"})" : json ? "{}" : "";
  if (!form_only) {
    add("unknown parameter", path + "?no_such=1", body, type, 400, "unknown_parameter");
  }
  if (operation.json.contains("requestBody")) {
    add("wrong type", path, "x", "text/plain", 415, "unsupported_content_type");
    add("oversized", path, std::string(1'200'000, 'x'),
        form_only ? "multipart/form-data; boundary=B" : type, 413, "body_too_large");
  }
  if (imports) add("no folder", path, "{}", type, 400, "missing_parameter");
  if (json) add("no JSON", path, "{", "application/json", 400, "invalid_json");
  if (image) {
    add("no picture", path, "hello", "image/png", 415, "image_type_unknown");
    add("half a picture", path, picture.substr(0, picture.size() / 2), "image/png", 422,
        "image_truncated");
    add("nothing", path, "", "", 400, "missing_parameter");
  }
  for (const Json& parameter : operation.json.value("parameters", Json::array())) {
    const std::string name = parameter["name"];
    if (parameter["in"] == "path") {
      std::string other = operation.path;
      const std::string place = "{" + name + "}";
      other.replace(other.find(place), place.size(), "no-such-thing");
      const bool makes_it = operation.method == "PUT" && operation.path.ends_with("}");
      if (makes_it && name != "c") continue;
      if (makes_it && operation.path.ends_with("{c}")) continue;
      const std::string code = name == "c"                     ? "collection_not_found"
                               : name == "o"                   ? "object_not_found"
                               : name == "v"                   ? "vocabulary_not_found"
                               : name == "n"                   ? "demo_not_found"
                               : name == "b"                   ? "backup_not_found"
                               : other.starts_with("/v1/jobs") ? "job_not_found"
                                                               : "image_not_found";
      if (!form_only) add("unknown " + name, Filled(other), body, type, 404, code);
      continue;
    }
    const Json schema = parameter.value("schema", Json::object());
    std::string bad;
    if (schema.contains("enum")) bad = "no-such-word";
    if (schema.value("type", "") == "integer" || schema.value("type", "") == "number") {
      bad = std::to_string(schema["minimum"].get<double>() - 1);
    }
    if (schema.value("type", "") == "array") bad = "1,x";
    if (!bad.empty() && !form_only) {
      add("bad " + name, path + "?" + name + "=" + bad, body, type, 400, "invalid_parameter");
    }
    if (name == "cursor") add("bad cursor", path + "?cursor=x", body, type, 400, "invalid_cursor");
  }
  return wrong;
}

TEST_F(OpenApiTest, WhatIsWrongIsAnsweredWithADocumentedCode) {
  auto client = server_->Client();
  int sent = 0;
  for (const Operation& operation : Operations()) {
    PrepareState();
    for (const Wrong& wrong : WrongRequests(operation)) {
      SCOPED_TRACE(operation.method + " " + operation.path + ": " + wrong.what);
      const auto answer = Send(client, wrong);
      ASSERT_TRUE(answer) << httplib::to_string(answer.error());
      EXPECT_EQ(answer->status, wrong.status) << answer->body;
      EXPECT_EQ(answer->get_header_value("Content-Type"), "application/problem+json");
      const Json problem = Json::parse(answer->body, nullptr, false);
      ASSERT_TRUE(problem.is_object()) << answer->body;
      EXPECT_EQ(problem["code"], wrong.code) << answer->body;
      EXPECT_TRUE(Documents(operation, wrong.status, wrong.code)) << "it is not documented";
      EXPECT_THAT(
          SchemaDifferences(document_, document_["components"]["schemas"]["Problem"], problem),
          IsEmpty());
      ++sent;
    }
  }
  EXPECT_GT(sent, 100);
}

TEST_F(OpenApiTest, OtherMethodsAreNotAllowed) {
  auto client = server_->Client();
  for (const auto& [path, methods] : document_["paths"].items()) {
    for (const std::string method : {"GET", "POST", "PUT", "DELETE", "PATCH"}) {
      std::string lower = method;
      for (char& c : lower) c = static_cast<char>(std::tolower(c));
      if (methods.contains(lower)) continue;
      const auto answer = Send(client, {"", method, Filled(path), "", "", 405, ""});
      ASSERT_TRUE(answer);
      EXPECT_EQ(answer->status, 405) << method << " " << path;
      EXPECT_FALSE(answer->get_header_value("Allow").empty());
    }
  }
}

TEST_F(OpenApiTest, NothingButWhatIsPublicAnswersWithoutAKey) {
  const std::filesystem::path database = folder_->path() / "keys.db";
  const ProgramResult made = Program({"keys", "create", "--name", "reader", "--scope", "read",
                                      "--db", database.string(), "--descriptor", "rootsift"},
                                     {}, ServerPath())
                                 .Wait();
  ASSERT_EQ(made.status, 0) << made.err;
  const std::string key = made.out.substr(0, made.out.find('\n'));
  const ServerProcess server(database);
  auto client = server.Client();
  for (const Operation& operation : Operations()) {
    SCOPED_TRACE(operation.method + " " + operation.path);
    const Wrong request = {"", operation.method, Filled(operation.path), "", "", 401, ""};
    client.set_default_headers({});
    const auto without = Send(client, request);
    ASSERT_TRUE(without);
    if (operation.IsPublic()) {
      EXPECT_LT(without->status, 400) << without->body;
      continue;
    }
    EXPECT_EQ(without->status, 401) << without->body;
    EXPECT_THAT(without->get_header_value("WWW-Authenticate"), ::testing::StartsWith("Bearer"));
    EXPECT_TRUE(Documents(operation, 401, "unauthorized"));
    client.set_default_headers({{"Authorization", "Bearer " + key}});
    const auto with = Send(client, request);
    ASSERT_TRUE(with);
    EXPECT_NE(with->status, 401) << with->body;
    const bool reads = operation.json["x-scope"] == "read";
    EXPECT_EQ(with->status == 403, !reads) << with->body;
    EXPECT_TRUE(Documents(operation, 403, "forbidden"));
  }
}

}  // namespace
}  // namespace pliant::testing
