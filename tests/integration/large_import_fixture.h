// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Imports larger than the bodies of other requests, for the parts of their tests.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/integration/server_fixture.h"
#include "tests/integration/tar_files.h"

namespace pliant::testing {

inline constexpr const char* kImport = "/v1/collections/default/images:import";
inline constexpr const char* kLines = "application/x-ndjson";
inline constexpr std::size_t kMiB = 1 << 20;  // --max-body-mb 1

class LargeImportTest : public ServerTest {
 protected:
  void StartSmall(std::vector<std::string> flags = {}) {
    flags.insert(flags.begin(), {"--auto-train", "false", "--max-body-mb", "1"});
    Start(flags);
    client_ = std::make_unique<httplib::Client>("127.0.0.1", server_->port());
    client_->set_read_timeout(60);
  }
  Json Finished(const std::string& path) {
    Json job;
    for (int i = 0; i < 20; ++i) {
      job = Json::parse(client_->Get(path + "?wait=30")->body);
      if (!job["finished_at"].is_null()) return job;
    }
    ADD_FAILURE() << "the import does not end: " << job;
    return job;
  }
  Json Finished(const httplib::Result& started) {
    EXPECT_TRUE(started && started->status == 202) << (started ? started->body : "no answer");
    if (!started || started->status != 202) return Json::object();
    return Finished(started->get_header_value("Location"));
  }
  Json Items(const Json& job) {
    const std::string path = "/v1/jobs/" + job["id"].get<std::string>() + "/items?limit=100";
    return Json::parse(client_->Get(path)->body)["items"];
  }
  int Images() { return Json::parse(client_->Get("/v1/collections/default")->body)["images"]; }

  // Bodies that wait beside the database.
  std::vector<std::filesystem::path> Files() const {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      const std::string name = entry.path().filename().string();
      if (name.find(".import-") != std::string::npos) files.push_back(entry.path());
    }
    return files;
  }
  // The last moments of a job, or of a connection, may come after what a client sees of them.
  void ExpectNoFiles() const {
    for (int i = 0; i < 100 && !Files().empty(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    EXPECT_TRUE(Files().empty()) << Files().front();
  }

  // Images from number `first` on, and so much besides that it is no usual body.
  static std::string Archive(std::uint64_t first, std::uint64_t count, std::size_t padding) {
    std::string archive;
    for (std::uint64_t i = first; i < first + count; ++i) {
      archive += TarEntry("shelf/o" + std::to_string(i) + ".png", TestImage(i));
      archive += TarEntry("shelf/.note" + std::to_string(i), std::string(padding / count, 'x'));
    }
    return archive + std::string(1024, '\0');
  }

  std::unique_ptr<httplib::Client> client_;
};

}  // namespace pliant::testing
