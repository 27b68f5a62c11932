// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A small fuzzer over the OpenAPI document: every operation with every parameter, field and header
// that it names, and values that nobody means. Whatever comes back must be documented, and the
// server must live. wrong_requests.h has those whose answer is known.
#include <iostream>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/openapi_fixture.h"
#include "tests/integration/strange_values.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kForm = "multipart/form-data; boundary=B";
constexpr unsigned kSeed = 20261;
constexpr int kMixed = 400;  // requests with several strange values at once

class FuzzTest : public OpenApiTest {
 protected:
  struct Sent {
    std::string method, path, body, type;
    httplib::Headers headers = {};
  };

  // Sends it, and looks at what comes back. `elsewhere`: the path may be another route's, or none.
  void Try(const Operation& operation, const Sent& sent, const std::string& what,
           bool elsewhere = false) {
    ++requests_;
    httplib::Request request;
    request.method = sent.method;
    request.path = sent.path;
    request.body = sent.body;
    request.headers = sent.headers;
    if (!sent.type.empty()) request.set_header("Content-Type", sent.type);
    // After 304, which has no length, clients of cpp-httplib wait for the end of the connection.
    if (sent.headers.contains("If-None-Match")) request.set_header("Connection", "close");
    const auto answer = client_.send(request);
    SCOPED_TRACE(operation.method + " " + operation.path + ": " + what.substr(0, 200));
    ASSERT_TRUE(answer) << httplib::to_string(answer.error());
    ++statuses_[answer->status];
    EXPECT_NE(answer->status, 500) << answer->body;
    if (answer->status < 400) {
      EXPECT_TRUE(elsewhere || operation.json["responses"].contains(std::to_string(answer->status)))
          << answer->status << " is not documented";
      return;
    }
    EXPECT_EQ(answer->get_header_value("Content-Type"), "application/problem+json");
    const Json problem = Json::parse(answer->body, nullptr, false);
    ASSERT_TRUE(problem.is_object()) << answer->body;
    const std::string code = problem.value("code", "");
    const bool none = code == "route_not_found" || code == "method_not_allowed";
    EXPECT_TRUE((elsewhere && none) || Documents(operation, answer->status, code))
        << answer->status << " " << code << " is not documented";
    EXPECT_EQ(problem["request_id"], answer->get_header_value("X-Request-Id"));
  }

  // What the operation takes when nothing is wrong.
  Sent Good(const Operation& operation) const {
    Sent sent{operation.method, Filled(operation.path), "", ""};
    if (operation.Takes("image/*")) {
      sent.body = image_;
      sent.type = "image/png";
    } else if (operation.Takes("application/json")) {
      sent.body = "{}";
      sent.type = "application/json";
    } else if (operation.Takes("multipart/form-data")) {
      sent.body = FormWith({});
      sent.type = kForm;
    }
    return sent;
  }

  // The same with a body that is soon refused as no image.
  Sent Cheap(const Operation& operation) const {
    Sent sent = Good(operation);
    if (sent.type == "image/png") sent.body = "no image";
    return sent;
  }

  static std::string FormWith(const std::vector<std::pair<std::string, std::string>>& fields) {
    std::string form =
        "--B\r\nContent-Disposition: form-data; name=\"image\"; filename=\"a.png\"\r\n\r\n" +
        image_ + "\r\n";
    for (const auto& [name, value] : fields) {
      form +=
          "--B\r\nContent-Disposition: form-data; name=\"" + name + "\"\r\n\r\n" + value + "\r\n";
    }
    return form + "--B--\r\n";
  }

  static std::vector<std::string> Parameters(const Operation& operation, const std::string& in) {
    std::vector<std::string> names;
    for (const Json& parameter : operation.json.value("parameters", Json::array())) {
      if (parameter["in"] == in) names.push_back(parameter["name"]);
    }
    return names;
  }

  // Those of the JSON body.
  static std::vector<std::string> Fields(const Operation& operation) {
    std::vector<std::string> names = {"no_such"};
    const Json properties = operation.json.value(
        Json::json_pointer("/requestBody/content/application~1json/schema/properties"),
        Json::object());
    for (const auto& [name, schema] : properties.items()) {
      names.push_back(name);
    }
    return names;
  }

  void TryQueries(const Operation& operation) {
    std::vector<std::string> names = Parameters(operation, "query");
    names.push_back("no_such");
    for (const std::string& name : names) {
      for (const std::string& text : StrangeTexts()) {
        Sent sent = name == "no_such" ? Cheap(operation) : Good(operation);
        sent.path += "?" + name + "=" + Encoded(text);
        Try(operation, sent, name + " in the query: " + text);
      }
    }
    Sent broken = Good(operation);
    broken.path += "?%zz&=&&%00=%&" + std::string(300, '=');
    Try(operation, broken, "a broken query");
  }

  void TryPaths(const Operation& operation) {
    for (const std::string& name : Parameters(operation, "path")) {
      for (const std::string& text : StrangeTexts()) {
        Sent sent = Cheap(operation);
        std::string path = operation.path;
        const std::string place = "{" + name + "}";
        sent.path = Filled(path.replace(path.find(place), place.size(), Encoded(text)));
        Try(operation, sent, name + " in the path: " + text, /*elsewhere=*/true);
      }
    }
  }

  void TryHeaders(const Operation& operation) {
    std::vector<std::string> names = Parameters(operation, "header");
    for (const char* name : {"Accept-Encoding", "X-Request-Id", "Authorization", "Origin", "Range",
                             "If-Match", "Content-Encoding", "Content-Type"}) {
      names.emplace_back(name);
    }
    for (const std::string& name : names) {
      for (const std::string& value : StrangeHeaders()) {
        Sent sent = Cheap(operation);
        if (name == "Content-Type") sent.type.clear();
        sent.headers.emplace(name, value);
        Try(operation, sent, name + ": " + value);
      }
    }
  }

  void TryJson(const Operation& operation) {
    for (const char* type : {"application/json", "application/merge-patch+json"}) {
      if (!operation.Takes(type)) continue;
      for (const std::string& body : StrangeBodies()) {
        Try(operation, {operation.method, Filled(operation.path), body, type}, "a body: " + body);
      }
    }
    if (!operation.Takes("application/json")) return;
    for (const std::string& name : Fields(operation)) {
      for (const std::string& value : StrangeJson()) {
        const std::string image =
            operation.Takes("image/*") && name != "image_id" ? "\"image_id\":\"mug-1\"," : "";
        Try(operation,
            {operation.method, Filled(operation.path),
             "{" + image + "\"" + name + "\":" + value + "}", "application/json"},
            name + " in JSON: " + value);
      }
    }
  }

  void TryForms(const Operation& operation) {
    if (!operation.Takes("multipart/form-data")) return;
    std::vector<std::string> names = Parameters(operation, "query");
    names.insert(names.end(), {"image", "no_such", ""});
    for (const std::string& name : names) {
      for (const std::string& text : {std::string(), std::string("\xff"), std::string("\0", 1),
                                      std::string(70'000, 'a'), Repeated("[", 60'000)}) {
        Try(operation, {operation.method, Filled(operation.path), FormWith({{name, text}}), kForm},
            name + " in a form: " + text);
      }
    }
    for (const char* type : {"multipart/form-data", "multipart/form-data; boundary=",
                             "multipart/form-data; boundary=\"", "image/", "image/png; q"}) {
      Try(operation, {operation.method, Filled(operation.path), FormWith({}), type}, type);
    }
  }

  void TryMixed(std::mt19937& random, const std::vector<Operation>& operations) {
    const auto any = [&](const auto& list) { return list[random() % list.size()]; };
    const Operation operation = any(operations);
    Sent sent = Good(operation);
    std::string query;
    for (const std::string& name : Parameters(operation, "query")) {
      if (random() % 2 == 0) query += "&" + name + "=" + Encoded(any(StrangeTexts()));
    }
    sent.path += "?" + query.substr(std::min<std::size_t>(1, query.size()));
    for (const std::string& name : Parameters(operation, "header")) {
      if (random() % 2 == 0) sent.headers.emplace(name, any(StrangeHeaders()));
    }
    if (sent.type == "application/json" && random() % 2 == 0) sent.body = any(StrangeBodies());
    Try(operation, sent, "mixed: " + sent.path);
  }

  inline static const std::string image_ = TestImage(1, 0, 160, 120);
  httplib::Client client_ = server_->Client();
  int requests_ = 0;
  std::map<int, int> statuses_;
};

TEST_F(FuzzTest, WhateverComesBackIsDocumented) {
  const auto begin = std::chrono::steady_clock::now();
  const std::vector<Operation> operations = Operations();
  for (const Operation& operation : operations) {
    // It would render objects for minutes.
    if (operation.json["operationId"] == "demo.load") continue;
    PrepareState();
    TryQueries(operation);
    TryPaths(operation);
    TryHeaders(operation);
    TryJson(operation);
    TryForms(operation);
    if (HasFatalFailure()) break;
  }
  std::cout << "seed of the mixed ones: " << kSeed << "\n";
  std::mt19937 random(kSeed);
  std::vector<Operation> mixable;
  for (const Operation& operation : operations) {
    if (operation.json["operationId"] != "demo.load") mixable.push_back(operation);
  }
  for (int i = 0; i < kMixed && !HasFatalFailure(); ++i) TryMixed(random, mixable);
  EXPECT_EQ(client_.Get("/livez")->status, 200);
  EXPECT_EQ(client_.Get("/readyz")->status, 200);
  EXPECT_THAT(server_->Log(), Not(HasSubstr("internal:")));
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  std::cout << requests_ << " requests in " << seconds.count() << " s; statuses:";
  for (const auto& [status, count] : statuses_) std::cout << " " << status << ": " << count;
  std::cout << "\n";
  EXPECT_GT(requests_, 3000);
}

}  // namespace
}  // namespace pliant::testing
