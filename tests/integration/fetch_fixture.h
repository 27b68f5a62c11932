// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A server that may fetch images from one other, which has good ones and others.
#pragma once

#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/elsewhere.h"
#include "tests/integration/server_fixture.h"

namespace pliant::testing {

inline constexpr const char* kJson = "application/json";

class FetchTest : public ServerTest {
 protected:
  void StartFetching(std::vector<std::string> flags = {"--fetch-private", "true"}) {
    flags.insert(flags.begin(), {"--fetch-hosts", other_.host()});
    Start(flags);
    client_ = std::make_unique<httplib::Client>("127.0.0.1", server_->port());
    client_->set_read_timeout(60);
  }

  static std::string AnswerTo(const std::string& head) {
    const std::size_t begin = head.find(' ') + 1;
    const std::string path = head.substr(begin, head.find_first_of(" ?", begin) - begin);
    if (path == "/broken.png") return Elsewhere::Ok(TestImage(1).substr(0, 500));
    if (path == "/gone.png") return "HTTP/1.1 404 No\r\nContent-Length: 0\r\n\r\n";
    if (path == "/page.html") return Elsewhere::Ok("<html>");
    if (path == "/empty.png") return Elsewhere::Ok("");
    if (path == "/large.png") return Elsewhere::Ok(std::string((1 << 20) + 1, 'x'));
    if (path == "/moved.png") return Elsewhere::Redirect("/1.png");
    if (path == "/away.png") return Elsewhere::Redirect("http://169.254.169.254/latest/meta-data");
    return Elsewhere::Ok(TestImage(static_cast<std::uint64_t>(std::atoi(path.c_str() + 1)),
                                   path.find("view") == std::string::npos ? 0 : 2),
                         "Content-Type: text/html\r\n");  // nobody looks at it
  }

  Json Ask(const std::string& path, const Json& body, int status) {
    const auto answer = PostPatiently(*client_, path, body.dump(), kJson);
    if (!answer) {
      ADD_FAILURE() << "no answer";
      return Json::object();
    }
    EXPECT_EQ(answer->status, status) << answer->body;
    return Json::parse(answer->body);
  }

  void Refused(const std::string& path, const Json& body, int status, const std::string& code,
               const std::string& parameter, const std::string& words = "") {
    const Json problem = Ask(path, body, status);
    EXPECT_EQ(problem.value("code", ""), code) << problem;
    EXPECT_EQ(problem.value("parameter", ""), parameter) << problem;
    EXPECT_THAT(problem.value("detail", ""), ::testing::HasSubstr(words));
  }

  Json Items(const std::string& lines) {
    const auto accepted =
        client_->Post("/v1/collections/default/images:import", lines, "application/x-ndjson");
    EXPECT_EQ(accepted->status, 202) << accepted->body;
    const std::string path = "/v1/jobs/" + Json::parse(accepted->body)["id"].get<std::string>();
    Json job;
    do {
      job = Json::parse(client_->Get(path + "?wait=30")->body);
    } while (job["finished_at"].is_null());
    EXPECT_EQ(job["state"], "done") << job;
    return Json::parse(client_->Get(path + "/items")->body)["items"];
  }

  Elsewhere other_{AnswerTo};
  std::unique_ptr<httplib::Client> client_;
};

}  // namespace pliant::testing
