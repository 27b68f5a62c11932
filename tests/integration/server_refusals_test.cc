// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Every operation of the OpenAPI document refuses what is wrong with the status and code that the
// document gives for it. The table is made of the document, and checked for gaps: a new route
// cannot be forgotten.
#include <algorithm>
#include <functional>
#include <iostream>
#include <map>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/json_schema.h"
#include "tests/integration/openapi_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::Contains;
using ::testing::IsEmpty;

constexpr const char* kForm = "multipart/form-data; boundary=B";

std::string Form(const std::vector<std::pair<std::string, std::string>>& fields) {
  std::string form;
  for (const auto& [name, value] : fields) {
    form += "--B\r\nContent-Disposition: form-data; name=\"" + name + "\"\r\n\r\n" + value + "\r\n";
  }
  return form + "--B--\r\n";
}

// A request that shall be refused.
struct Wrong {
  std::string kind;  // what must not be missing for any operation: see MustHave
  std::string what, method, path, body, type;
  int status = 0;
  std::string code;
};

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

// All the wrong requests for one operation.
class WrongRequests {
 public:
  WrongRequests(const Operation& operation, std::string path,
                const std::function<std::string(std::string)>& filled)
      : operation_(operation),
        path_(std::move(path)),
        image_(operation.Takes("image/*")),
        json_(operation.Takes("application/json")),
        form_only_(operation.Takes("multipart/form-data") && !image_) {
    type_ = image_ ? "image/png" : json_ ? "application/json" : form_only_ ? kForm : "";
    body_ = GoodBody();
    AddBodyFaults();
    AddMissingFields();
    AddPathFaults(filled);
    AddParameterFaults();
  }

  const std::vector<Wrong>& all() const { return wrong_; }

  // Kinds of faults that an operation of this form can meet.
  std::set<std::string> MustHave() const {
    std::set<std::string> kinds = {"unknown parameter", "oversized address"};
    if (operation_.json.contains("requestBody")) kinds.insert({"wrong type", "oversized"});
    if (image_ || form_only_ || !RequiredFields().empty()) kinds.insert("missing field");
    for (const Json& parameter : operation_.json.value("parameters", Json::array())) {
      if (parameter["in"] == "path" && !Makes(parameter["name"])) kinds.insert("unknown id");
    }
    return kinds;
  }

 private:
  void Add(const std::string& kind, const std::string& what, const std::string& at,
           const std::string& body, const std::string& type, int status, const std::string& code) {
    wrong_.push_back({kind, what, operation_.method, at, body, type, status, code});
  }

  // PUT makes what its path names last.
  bool Makes(const std::string& name) const {
    return operation_.method == "PUT" && operation_.path.ends_with("{" + name + "}");
  }

  std::vector<std::string> RequiredFields() const {
    if (!json_ || image_) return {};
    return operation_.json["requestBody"]["content"]["application/json"]["schema"].value(
        "required", std::vector<std::string>{});
  }

  std::string GoodBody() const {
    if (image_) return TestPicture(1);
    if (form_only_) return Form({{"image", TestPicture(1)}});
    Json body = Json::object();
    for (const std::string& field : RequiredFields()) body[field] = "shelf";
    return json_ ? body.dump() : "";
  }

  void AddBodyFaults() {
    if (!operation_.json.contains("requestBody")) return;
    Add("wrong type", "text", path_, "x", "text/plain", 415, "unsupported_content_type");
    if (!json_)
      Add("wrong type", "JSON", path_, "{}", "application/json", 415, "unsupported_content_type");
    if (!image_)
      Add("wrong type", "a picture", path_, TestPicture(1), "image/png", 415,
          "unsupported_content_type");
    Add("oversized", "body", path_, std::string(1'200'000, 'x'), type_, 413, "body_too_large");
    if (json_) Add("no JSON", "cut off", path_, "{", "application/json", 400, "invalid_json");
    if (json_) Add("no JSON", "a list", path_, "[]", "application/json", 400, "invalid_json");
    if (form_only_ || image_) {
      Add("no form", "without boundary", path_, body_, "multipart/form-data", 400, "bad_request");
      Add("no form", "cut off", path_, Form({{"image", "x"}}).substr(0, 40), kForm, 400,
          "bad_request");
    }
    if (!image_) return;
    const std::string half = body_.substr(0, body_.size() / 2);
    Add("no picture", "text", path_, "hello", type_, 415, "image_type_unknown");
    Add("no picture", "half", path_, half, type_, 422, "image_truncated");
    Add("no picture", "in a form", path_, Form({{"image", "hello"}}), kForm, 415,
        "image_type_unknown");
  }

  void AddMissingFields() {
    for (const std::string& field : RequiredFields()) {
      Add("missing field", field, path_, "{}", type_, 400, "missing_parameter");
      Add("missing field", field + " and body", path_, "", "", 400, "missing_parameter");
    }
    if (!image_ && !form_only_) return;
    Add("missing field", "body", path_, "", image_ ? "" : kForm, 400, "missing_parameter");
    const bool limit = operation_.path.ends_with("/search");
    const bool locate = operation_.path.ends_with("/locate");  // it has no other fields
    const auto others = Form({{limit ? "limit" : "object", "1"}});
    Add("missing field", "image", path_, locate ? Form({}) : others, kForm, 400,
        locate ? "bad_request" : "missing_parameter");
    if (json_)
      Add("missing field", "image_id", path_, "{}", "application/json", 400, "missing_parameter");
  }

  void AddPathFaults(const std::function<std::string(std::string)>& filled) {
    Add("oversized address", "query", path_ + "?x=" + std::string(9000, 'a'), body_, type_, 414,
        "uri_too_long");
    for (const Json& parameter : operation_.json.value("parameters", Json::array())) {
      const std::string name = parameter["name"];
      if (parameter["in"] != "path") continue;
      const auto with = [&](const std::string& value) {
        std::string path = operation_.path;
        const std::string place = "{" + name + "}";
        return filled(path.replace(path.find(place), place.size(), value));
      };
      Add("oversized address", name, with(std::string(2100, 'a')), body_, type_, 414,
          "uri_too_long");
      if (Makes(name)) {
        Add("bad id", name, with("a%20b"), body_, type_, 400, "invalid_parameter");
        continue;
      }
      static const std::map<std::string, std::string> codes = {
          {"c", "collection_not_found"}, {"o", "object_not_found"}, {"v", "vocabulary_not_found"},
          {"n", "demo_not_found"},       {"b", "backup_not_found"}, {"id", "image_not_found"}};
      const bool job = operation_.path.starts_with("/v1/jobs");
      Add("unknown id", name, with("no-such-thing"), body_, type_, 404,
          job ? "job_not_found" : codes.at(name));
    }
  }

  void AddParameterFaults() {
    Add("unknown parameter", "in the query", path_ + "?no_such=1", body_, type_, 400,
        "unknown_parameter");
    if (form_only_ || image_) {
      Add("unknown parameter", "in a form", path_,
          Form({{"image", TestPicture(1)}, {"no_such", "1"}}), kForm, 400, "unknown_parameter");
    }
    if (json_)
      Add("unknown parameter", "in JSON", path_, R"({"no_such": 1})", "application/json", 400,
          "unknown_parameter");
    for (const Json& parameter : operation_.json.value("parameters", Json::array())) {
      if (parameter["in"] == "path") continue;
      const std::string name = parameter["name"];
      const auto with = [&](const std::string& value) { return path_ + "?" + name + "=" + value; };
      Add("bad parameter", name + " not UTF-8", with("%ff"), body_, type_, 400,
          "invalid_parameter");
      Add("bad parameter", name + " twice", with("1") + "&" + name + "=2", body_, type_, 400,
          IsText(parameter) ? "duplicate_parameter" : "");
      if (parameter.contains("content")) {
        Add("bad parameter", name, with("{"), body_, type_, 400, "invalid_json");
        continue;
      }
      const Json& schema = parameter["schema"];
      std::vector<std::string> bad;
      if (schema.contains("enum")) bad = {"no-such-word", ""};
      if (schema["type"] == "integer" || schema["type"] == "number") {
        bad = {std::to_string(schema["minimum"].get<double>() - 1), "x", ""};
      }
      if (schema["type"] == "array") bad = {"1,x"};
      for (const std::string& value : bad) {
        Add("bad parameter", name, with(value), body_, type_, 400, "invalid_parameter");
      }
      if (name == "cursor") Add("bad cursor", name, with("x"), body_, type_, 400, "invalid_cursor");
    }
  }

  // Any text will do, so that it is only wrong to give it twice.
  static bool IsText(const Json& parameter) {
    return parameter.contains("schema") && parameter["schema"]["type"] == "string" &&
           !parameter["schema"].contains("enum");
  }

  const Operation& operation_;
  std::string path_;
  bool image_, json_, form_only_;
  std::string type_, body_;
  std::vector<Wrong> wrong_;
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
        EXPECT_NE(with->status, 403) << scope << with->body;
      }
    }
  }
}

}  // namespace
}  // namespace pliant::testing
