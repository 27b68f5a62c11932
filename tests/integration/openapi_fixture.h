// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A server with a little of everything in it, and its OpenAPI document.
#pragma once

#include <chrono>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {

struct Operation {
  std::string path, method;  // as in the document
  Json json;

  bool Takes(const std::string& media_type) const {
    return json.contains("requestBody") && json["requestBody"]["content"].contains(media_type);
  }
  bool IsPublic() const { return json["x-scope"] == "public"; }
};

class OpenApiTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    std::filesystem::create_directories(folder_->path() / "backups");
    // As few restrictions as an example may meet.
    server_ = std::make_unique<ServerProcess>(
        folder_->path() / "test.db",
        std::vector<std::string>{"--auto-train", "false", "--max-body-mb", "1", "--max-import-mb",
                                 "1", "--backup-dir", (folder_->path() / "backups").string(),
                                 "--import-dir", folder_->path().string()});
    Save("mug.png", TestImage(1));
    Save("cup.png", TestImage(2));
    std::filesystem::create_directories(folder_->path() / "shelf");
    Save("shelf/plate.png", TestImage(3));
    auto client = server_->Client();
    document_ = Json::parse(client.Get("/v1/openapi.json")->body);
    PrepareState();
    for (const auto& [path, body] : {std::pair("vocabularies", R"({"words": 20})"),
                                     std::pair("selftest", R"({"pictures": 1})")}) {
      const auto accepted =
          client.Post(std::string("/v1/collections/default/") + path, body, "application/json");
      job_ = Json::parse(accepted->body)["id"];
      while (Json::parse(client.Get("/v1/jobs/" + job_)->body)["finished_at"].is_null()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
    }
    const Json list = Json::parse(client.Get("/v1/collections/default/vocabularies")->body);
    vocabulary_ = list["vocabularies"].back()["id"].dump();
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
    ASSERT_TRUE(client.Patch("/v1/aliases",
                             R"({"live": "default", "old": "default", "before": "toys"})",
                             "application/json"));
    const auto mug =
        client.Put("/v1/collections/default/images/mug-1?object=mug", TestImage(1), "image/png");
    ASSERT_LT(mug->status, 300) << mug->body;
    client.Post("/v1/backups", R"({"name": "first.db"})", "application/json");
    while (client.Get("/v1/backups/first.db")->status != 200) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  static std::vector<Operation> Operations() {
    std::vector<Operation> operations;
    for (const auto& [path, methods] : document_["paths"].items()) {
      for (const auto& [method, json] : methods.items()) {
        std::string upper = method;
        for (char& c : upper) c = static_cast<char>(std::toupper(c));
        operations.push_back({path, upper, json});
        ResolveBody(operations.back().json);
      }
    }
    return operations;
  }

  // Puts the schemas of bodies in the place of references to them.
  static void ResolveBody(Json& operation) {
    if (!operation.contains("requestBody")) return;
    for (Json& media : operation["requestBody"]["content"]) {
      const Json schema = media.value("schema", Json::object());
      if (!schema.contains("$ref")) continue;
      media["schema"] =
          document_.at(Json::json_pointer(schema["$ref"].get<std::string>().substr(1)));
    }
  }

  static std::string Filled(std::string path) {
    const std::pair<std::string, std::string> values[] = {
        {"{a}", "live"},
        {"{c}", "default"},
        {"{o}", "mug"},
        {"{v}", vocabulary_},
        {"{b}", "first.db"},
        {"{k}", "00000000"},
        {"{id}", path.starts_with("/v1/jobs") ? job_ : "mug-1"}};
    for (const auto& [name, value] : values) {
      const std::size_t at = path.find(name);
      if (at != std::string::npos) path.replace(at, name.size(), value);
    }
    return path;
  }

  static bool Documents(const Operation& operation, int status, const std::string& code) {
    const Json response = operation.json["responses"].value(std::to_string(status), Json());
    if (response.is_null()) return false;
    const Json codes = response.value(
        Json::json_pointer(
            "/content/application~1problem+json/schema/allOf/1/properties/code/enum"),
        Json::array());
    return std::find(codes.begin(), codes.end(), code) != codes.end();
  }

  inline static std::unique_ptr<TemporaryFolder> folder_;
  inline static std::unique_ptr<ServerProcess> server_;
  inline static Json document_;
  inline static std::string job_;
  inline static std::string vocabulary_;
};

}  // namespace pliant::testing
