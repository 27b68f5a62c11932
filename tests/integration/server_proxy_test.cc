// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A server behind a reverse proxy: what trusted proxies tell, and Debian's nginx, which terminates
// TLS and serves Pliant below a path, with the configuration in server/PROXY.md.
#include <fstream>
#include <regex>
#include <sstream>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/integration/certificate.h"
#include "tests/integration/server_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr const char* kNginx = "/usr/sbin/nginx";
const httplib::Headers kAlice = {{"X-Forwarded-For", "198.51.100.7"}};
const httplib::Headers kBob = {{"X-Forwarded-For", "198.51.100.8"}};

class ServerProxyTest : public ServerTest {
 protected:
  // A POST whose body does not come, as a proxy would send it for the client.
  int Upload(const std::string& client) {
    return server_->Open("POST " + std::string(kImages) +
                         " HTTP/1.1\r\nHost: localhost\r\nContent-Type: image/png\r\n"
                         "Expect: 100-continue\r\nContent-Length: 9\r\nX-Forwarded-For: " +
                         client + "\r\n\r\n");
  }
};

// What comes next on the socket.
std::string Next(int fd) {
  std::array<char, 4096> buffer{};
  const ssize_t got = recv(fd, buffer.data(), buffer.size(), 0);
  return {buffer.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0))};
}

TEST_F(ServerProxyTest, TheClientIsLoggedAndLimited) {
  Start({"--trusted-proxies", "127.0.0.1", "--rate-limit", "1", "--rate-burst", "2", "--auto-train",
         "false"});
  auto client = server_->Client();
  const auto first = client.Get("/v1/collections", kAlice);
  EXPECT_EQ(first->status, 200);
  EXPECT_EQ(first->get_header_value("RateLimit-Limit"), "2");
  EXPECT_EQ(first->get_header_value("RateLimit-Remaining"), "1");
  EXPECT_EQ(first->get_header_value("RateLimit-Reset"), "1");
  int refused = 0;
  for (int i = 0; i < 20 && refused == 0; ++i) {
    const auto answer = client.Get("/v1/collections", kAlice);
    if (answer->status == 200) continue;
    refused = answer->status;
    EXPECT_EQ(answer->get_header_value("RateLimit-Remaining"), "0");
  }
  EXPECT_EQ(refused, 429);
  EXPECT_EQ(client.Get("/v1/collections", kBob)->status, 200);
  EXPECT_THAT(server_->Log(), HasSubstr("from=198.51.100.7 "));
  EXPECT_THAT(server_->Log(), HasSubstr("from=198.51.100.8 "));
}

TEST_F(ServerProxyTest, ConnectionsAreCountedForTheClient) {
  Start({"--trusted-proxies", "127.0.0.1", "--connections-per-address", "1", "--auto-train",
         "false"});
  const int alice = Upload("198.51.100.7");
  EXPECT_THAT(Next(alice), StartsWith("HTTP/1.1 100"));
  const int again = Upload("198.51.100.7");
  EXPECT_THAT(Next(again), StartsWith("HTTP/1.1 503"));
  const int bob = Upload("198.51.100.8");
  EXPECT_THAT(Next(bob), StartsWith("HTTP/1.1 100"));
  for (const int fd : {alice, again, bob}) close(fd);
}

TEST_F(ServerProxyTest, OthersAreNotBelieved) {
  Start({"--auto-train", "false"});
  const auto answer =
      server_->Client().Get("/v1/openapi.json", {{"X-Forwarded-For", "198.51.100.7"},
                                                 {"X-Forwarded-Prefix", "/x"},
                                                 {"X-Forwarded-Host", "evil.example"}});
  EXPECT_EQ(Json::parse(answer->body)["servers"][0]["url"], "/");
  EXPECT_THAT(server_->Log(), HasSubstr("from=127.0.0.1 "));
}

TEST_F(ServerProxyTest, ABasePathThatIsNoneIsWrongUsage) {
  for (const char* path : {"pliant", "/x/", "/x//y", "/x/../y", "/."}) {
    const ProgramResult refused = Program({"--db", (folder_ / "none.db").string(), "--listen",
                                           "127.0.0.1:0", "--base-path", path},
                                          {}, ServerPath())
                                      .Wait();
    EXPECT_EQ(refused.status, 2) << path;
    EXPECT_THAT(refused.err, HasSubstr("--base-path must be a path"));
  }
}

TEST_F(ServerProxyTest, ABasePathIsRemovedAndAdded) {
  Start({"--base-path", "/pliant", "--auto-train", "false"});
  auto client = server_->Client();
  const std::string places = "/pliant" + std::string(kImages);
  const auto made = client.Put(places + "/one", TestImage(1), "image/png");
  ASSERT_EQ(made->status, 201) << made->body;
  EXPECT_EQ(made->get_header_value("Location"), places + "/one");
  EXPECT_EQ(client.Get(std::string(kImages) + "/one")->status, 200) << "a proxy can remove it, too";
  const auto folder = client.Get("/pliant");
  EXPECT_EQ(folder->status, 308);
  EXPECT_EQ(folder->get_header_value("Location"), "/pliant/");
  EXPECT_EQ(client.Get("/pliant/")->status, 200);
  EXPECT_EQ(client.Get("/pliantx")->status, 404);
  EXPECT_EQ(client.Get("/pliant/livez")->status, 200);
  EXPECT_EQ(Json::parse(client.Get("/pliant/v1/openapi.json")->body)["servers"][0]["url"],
            "/pliant");
  const Json demo = Json::parse(client.Get("/pliant/v1/collections/default/demo")->body);
  EXPECT_EQ(client.Get(demo["objects"][0]["crumpled"].get<std::string>())->status, 200);
}

// The indented block of server/PROXY.md that begins with that line.
std::string Example(const std::string& first) {
  std::ifstream page(PLIANT_SOURCE_DIR "/server/PROXY.md");
  std::string text;
  for (std::string line; std::getline(page, line);) {
    if (!text.empty() || line == "    " + first) text += line + "\n";
    if (!text.empty() && line == "    }") break;
  }
  return text;
}

// Free a moment ago.
int FreePort() {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return 0;
  sockaddr_in address{
      .sin_family = AF_INET, .sin_port = 0, .sin_addr = {htonl(INADDR_LOOPBACK)}, .sin_zero = {}};
  socklen_t length = sizeof(address);
  auto* name = reinterpret_cast<sockaddr*>(&address);
  if (bind(fd, name, length) != 0 || getsockname(fd, name, &length) != 0) address.sin_port = 0;
  close(fd);
  return ntohs(address.sin_port);
}

std::string Replaced(const std::string& text, const std::string& what, const std::string& with) {
  EXPECT_THAT(text, HasSubstr(what)) << "server/PROXY.md";
  return std::regex_replace(text, std::regex(what), with);
}

TEST_F(ServerProxyTest, NginxServesPliantBelowAPathWithTls) {
  ASSERT_TRUE(std::filesystem::exists(kNginx)) << "install docker/packages-test.txt";
  Start({"--base-path", "/pliant", "--trusted-proxies", "127.0.0.1", "--allowed-hosts",
         "images.example", "--auto-train", "false"});
  WriteCertificate(folder_ / "cert.pem", folder_ / "key.pem", false, "IP:127.0.0.1");
  const int port = FreePort();
  std::string site = Example("server {");
  site = Replaced(site, "443", "127.0.0.1:" + std::to_string(port));
  site = Replaced(site, "/etc/ssl/images.example.pem", (folder_ / "cert.pem").string());
  site = Replaced(site, "/etc/ssl/images.example.key", (folder_ / "key.pem").string());
  site = Replaced(site, "127.0.0.1:8080", "127.0.0.1:" + std::to_string(server_->port()));
  const std::string folder = folder_.path().string();
  std::ostringstream text;
  text << "daemon off;\nmaster_process off;\npid " << folder
       << "/nginx.pid;\nerror_log stderr;\nevents {}\nhttp {\n"
       << "access_log off;\n";
  for (const char* kind : {"client_body", "proxy", "fastcgi", "uwsgi", "scgi"}) {
    text << kind << "_temp_path " << folder << "/" << kind << ";\n";
  }
  std::ofstream(folder_ / "nginx.conf") << text.str() << site << "}\n";
  Program nginx({"-e", "stderr", "-p", folder, "-c", (folder_ / "nginx.conf").string()}, {},
                kNginx);

  httplib::SSLClient client("127.0.0.1", port);
  client.set_ca_cert_path((folder_ / "cert.pem").string());
  client.enable_server_certificate_verification(true);
  while (nginx.IsRunning() && !client.Get("/pliant/livez")) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ASSERT_TRUE(nginx.IsRunning()) << nginx.Err();
  const std::string name = "images.example:" + std::to_string(port);
  client.set_default_headers({{"Host", name}, {"Origin", "https://" + name}});
  EXPECT_THAT(client.Get("/pliant/")->body, HasSubstr("src=\"assets/app.js\""));
  EXPECT_EQ(client.Get("/pliant/assets/app.js")->status, 200);
  EXPECT_EQ(client.Get("/v1/collections")->status, 404) << "only below the path";
  const std::string places = "/pliant" + std::string(kImages);
  const std::string image = TestImage(1);
  auto made = client.Post(places, {{"X-Forwarded-For", "198.51.100.7"}},
                          httplib::MultipartFormDataItems{{"image", image, "a.png", "image/png"},
                                                          {"id", "one", "", ""}});
  ASSERT_TRUE(made) << httplib::to_string(made.error());
  ASSERT_EQ(made->status, 201) << made->body;
  EXPECT_EQ(made->get_header_value("Location"), places + "/one");
  EXPECT_THAT(made->get_header_value("Strict-Transport-Security"), HasSubstr("max-age="));
  EXPECT_EQ(client.Get(made->get_header_value("Location") + "/content")->body, image);
  EXPECT_EQ(Json::parse(client.Get("/pliant/v1/openapi.json")->body)["servers"][0]["url"],
            "/pliant");
  EXPECT_THAT(server_->Log(), HasSubstr("from=198.51.100.7 "))
      << "nginx adds 127.0.0.1, which is trusted";
  nginx.Signal(SIGTERM);
  EXPECT_EQ(nginx.Wait().status, 0);
}

}  // namespace
}  // namespace pliant::testing
