// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Fetching images from a server that means no good, without a server of Pliant's around it.
#include "server/fetch/fetcher.h"

#include <chrono>
#include <cstdlib>
#include <future>
#include <optional>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>

#include "server/http/problem.h"
#include "tests/integration/certificate.h"
#include "tests/integration/elsewhere.h"
#include "tests/integration/program.h"

namespace pliant::testing {
namespace {

using server::Fetcher;
using server::FetchOptions;
using server::Problem;
using Clock = std::chrono::steady_clock;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kImage = "the bytes of an image";

std::string PathOf(const std::string& head) {
  const std::size_t begin = head.find(' ') + 1;
  return head.substr(begin, head.find(' ', begin) - begin);
}

class FetcherTest : public ::testing::Test {
 protected:
  // What the other server answers with, by path.
  std::string AnswerTo(const std::string& head) {
    const std::string path = PathOf(head);
    if (path.starts_with("/to/")) return Elsewhere::Redirect(path.substr(4));
    if (path.starts_with("/again/")) {
      const int left = std::stoi(path.substr(7));
      return Elsewhere::Redirect(left > 1 ? "/again/" + std::to_string(left - 1) : "../image.png");
    }
    if (path.starts_with("/status/")) {
      return "HTTP/1.1 " + path.substr(8) + " Odd\r\nContent-Length: 4\r\n\r\nbody";
    }
    const auto special = special_.find(path);
    return special == special_.end() ? Elsewhere::Ok(kImage) : special->second;
  }

  FetchOptions Options() const {
    FetchOptions options;
    options.hosts = {other_.host()};
    options.allow_private = true;
    options.max_bytes = 1000;
    options.timeout = std::chrono::milliseconds(5'000);
    options.user_agent = "Pliant/test";
    return options;
  }

  std::string Fetched(const FetchOptions& options, const std::string& url) {
    Fetcher fetcher(options);
    const server::FetchedImage image = fetcher.Fetch(url);
    return {image.bytes->begin(), image.bytes->end()};
  }

  static Problem ProblemOf(Fetcher& fetcher, const std::string& url,
                           Fetcher::For whom = Fetcher::For::kRequest) {
    try {
      fetcher.Fetch(url, whom);
    } catch (...) {
      return server::CurrentProblem();
    }
    ADD_FAILURE() << url << " was fetched";
    return {};
  }

  static Problem ProblemOf(const FetchOptions& options, const std::string& url) {
    Fetcher fetcher(options);
    return ProblemOf(fetcher, url);
  }

  void ExpectProblem(const FetchOptions& options, const std::string& url, const std::string& code,
                     const std::string& words) {
    const Problem problem = ProblemOf(options, url);
    EXPECT_EQ(problem.code, code) << url << ": " << problem.detail;
    EXPECT_EQ(problem.parameter, "image_url");
    EXPECT_THAT(problem.detail, HasSubstr(words)) << url;
    EXPECT_THAT(problem.detail, Not(HasSubstr("127.0.0.1"))) << "addresses are for the log";
  }

  std::map<std::string, std::string> special_;
  Elsewhere other_{[this](const std::string& head) { return AnswerTo(head); }};
};

TEST_F(FetcherTest, FetchesAndSaysLittleOfItself) {
  setenv("http_proxy", "http://127.0.0.1:9", 1);
  setenv("HTTPS_PROXY", "http://127.0.0.1:9", 1);
  Fetcher fetcher(Options());
  const auto image = fetcher.Fetch(other_.url("/a/image.png?token=secret#part"));
  unsetenv("http_proxy");
  unsetenv("HTTPS_PROXY");
  EXPECT_EQ(std::string(image.bytes->begin(), image.bytes->end()), kImage);
  EXPECT_EQ(image.source, other_.url("/a/image.png"));
  const std::string head = other_.heads().at(0);
  EXPECT_THAT(head, HasSubstr("GET /a/image.png?token=secret HTTP/1.1\r\n"));
  EXPECT_THAT(head, HasSubstr("Host: " + other_.host() + "\r\n"));
  EXPECT_THAT(head, HasSubstr("User-Agent: Pliant/test\r\n"));
  EXPECT_THAT(head, HasSubstr("Accept-Encoding: identity\r\n"));
  for (const char* header : {"Cookie", "Authorization", "Referer"}) {
    EXPECT_THAT(head, Not(HasSubstr(header)));
  }
}

TEST_F(FetcherTest, OnlyFromHostsAndPortsThatAreAllowed) {
  FetchOptions off;
  ExpectProblem(off, other_.url("/"), "fetch_off", "--fetch-hosts");
  FetchOptions others = Options();
  others.hosts = {"127.0.0.1", "localhost:" + std::to_string(other_.port() + 1), "*.test"};
  ExpectProblem(others, other_.url("/"), "fetch_host_not_allowed", "this host and port");
  FetchOptions here = Options();
  const std::string port = std::to_string(other_.port());
  ExpectProblem(here, "http://localhost:" + port + "/", "fetch_host_not_allowed", "this host");
  ExpectProblem(here, "http://127.0.0.1.evil.test:" + port + "/", "fetch_host_not_allowed", "this");
  EXPECT_EQ(ProblemOf(here, "file:///etc/passwd").code, "invalid_parameter");
  EXPECT_EQ(ProblemOf(here, "http://u:p@127.0.0.1:" + port + "/").code, "invalid_parameter");
  EXPECT_EQ(other_.connections(), 0);
}

// The operator allows a name; what it leads to is looked at when it is connected to.
TEST_F(FetcherTest, AddressesAreCheckedWhateverTheNameIs) {
  const std::string port = std::to_string(other_.port());
  FetchOptions options = Options();
  options.allow_private = false;
  options.hosts = {"127.0.0.1:" + port, "localhost:" + port, "[::ffff:127.0.0.1]:" + port,
                   "*.test:" + port};
  options.resolve = {"rebound.test:" + port + ":127.0.0.1", "inner.test:" + port + ":10.0.0.1",
                     "both.test:" + port + ":127.0.0.1,[::1],192.168.1.1"};
  for (const std::string host :
       {"127.0.0.1", "127.1", "2130706433", "0x7f000001", "localhost", "[::ffff:127.0.0.1]",
        "[::ffff:7f00:1]", "rebound.test", "inner.test", "both.test"}) {
    ExpectProblem(options, "http://" + host + ":" + port + "/", "fetch_host_not_allowed",
                  "no public address");
  }
  EXPECT_EQ(other_.connections(), 0);
  options.allow_private = true;
  EXPECT_EQ(Fetched(options, "http://rebound.test:" + port + "/"), kImage);
  // Where clouds keep their secrets, and what is no host's, stays closed.
  options.resolve = {"cloud.test:" + port + ":169.254.169.254", "any.test:" + port + ":0.0.0.0",
                     "many.test:" + port + ":224.0.0.1", "local.test:" + port + ":[fe80::1]",
                     "nat.test:" + port + ":[64:ff9b::7f00:1]"};
  for (const std::string host : {"cloud.test", "any.test", "many.test", "local.test", "nat.test"}) {
    ExpectProblem(options, "http://" + host + ":" + port + "/", "fetch_host_not_allowed",
                  "no public address");
  }
}

TEST_F(FetcherTest, WhatAnInterimAnswerNamesIsNoRedirection) {
  special_["/early"] =
      "HTTP/1.1 103 Early Hints\r\nLocation: /wrong\r\n\r\n" + Elsewhere::Redirect("/right.png");
  Fetcher fetcher(Options());
  fetcher.Fetch(other_.url("/early"));
  EXPECT_THAT(other_.heads().back(), HasSubstr("GET /right.png "));
}

TEST_F(FetcherTest, RedirectionsAreCheckedAlike) {
  EXPECT_EQ(Fetched(Options(), other_.url("/again/3")), kImage);
  ExpectProblem(Options(), other_.url("/again/4"), "fetch_failed", "more than 3 times");
  Elsewhere secret([](const std::string&) { return Elsewhere::Ok("secret"); });
  ExpectProblem(Options(), other_.url("/to/" + secret.url("/")), "fetch_host_not_allowed",
                "redirects to");
  const std::string port = std::to_string(secret.port());
  FetchOptions options = Options();
  options.allow_private = false;
  options.hosts = {"*.test:" + std::to_string(other_.port()), "*.test:" + port};
  options.resolve = {"start.test:" + std::to_string(other_.port()) + ":127.0.0.1",
                     "inner.test:" + port + ":127.0.0.1"};
  const std::string start = "http://start.test:" + std::to_string(other_.port());
  ExpectProblem(options, start + "/to/http://inner.test:" + port + "/", "fetch_host_not_allowed",
                "no public address");
  options.allow_private = true;
  options.resolve.back() = "inner.test:" + port + ":169.254.169.254";
  ExpectProblem(options, start + "/to/http://inner.test:" + port + "/", "fetch_host_not_allowed",
                "no public address");
  EXPECT_EQ(secret.connections(), 0);
  for (const std::string where : {"file:///etc/passwd", "ftp://127.0.0.1/", "//u:p@127.0.0.1/"}) {
    ExpectProblem(Options(), other_.url("/to/" + where), "fetch_failed",
                  "redirects to an invalid address");
  }
  ExpectProblem(Options(), other_.url("/status/302"), "fetch_failed", "answered with status 302");
}

TEST_F(FetcherTest, OnlyWholeImagesOfAStatedSize) {
  const std::string large(1001, 'x');
  special_["/most"] = Elsewhere::Ok(large.substr(1));
  special_["/said"] = Elsewhere::Ok(large);
  special_["/lied"] = "HTTP/1.1 200 OK\r\n\r\n" + large;
  special_["/chunks"] =
      "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3e9\r\n" + large + "\r\n0\r\n\r\n";
  special_["/short"] = "HTTP/1.1 200 OK\r\nContent-Length: 99\r\n\r\nx";
  special_["/none"] = "";
  special_["/noise"] = "what is this\r\n\r\n";
  special_["/heads"] = "HTTP/1.1 200 OK\r\n";
  for (int i = 0; i < 100; ++i) special_["/heads"] += "X-Y: " + std::string(1000, 'y') + "\r\n";
  special_["/heads"] += "\r\nx";
  special_["/packed"] = Elsewhere::Ok("\x1f\x8b packed", "Content-Encoding: gzip\r\n");
  special_["/large404"] = "HTTP/1.1 404 No\r\nContent-Length: 99999\r\n\r\n" + large;
  EXPECT_EQ(Fetched(Options(), other_.url("/most")).size(), 1000U);
  for (const char* path : {"/said", "/lied", "/chunks"}) {
    ExpectProblem(Options(), other_.url(path), "fetch_failed", "larger than 1000 bytes");
  }
  for (const char* path : {"/short", "/none", "/noise", "/heads"}) {
    ExpectProblem(Options(), other_.url(path), "fetch_failed", "not send a complete answer");
  }
  EXPECT_EQ(Fetched(Options(), other_.url("/packed")), "\x1f\x8b packed") << "nothing is unpacked";
  ExpectProblem(Options(), other_.url("/large404"), "fetch_failed", "answered with status 404");
  for (const char* status : {"201", "204", "206", "304", "401", "404", "500", "503"}) {
    ExpectProblem(Options(), other_.url(std::string("/status/") + status), "fetch_failed",
                  std::string("answered with status ") + status);
  }
}

TEST_F(FetcherTest, TakesNoLongerThanItMay) {
  special_["/drip"] = Elsewhere::Ok(std::string(900, 'x'));
  FetchOptions options = Options();
  options.timeout = std::chrono::milliseconds(700);
  for (const char* path : {"/drip", "/silent"}) {
    const auto begin = Clock::now();
    ExpectProblem(options, other_.url(path), "fetch_failed", "longer than 0.7 s");
    EXPECT_LT(Clock::now() - begin, std::chrono::seconds(5)) << path;
  }
  // All redirections together.
  special_["/drip-on"] = Elsewhere::Redirect("/drip-on");
  ExpectProblem(options, other_.url("/drip-on"), "fetch_failed", "longer than 0.7 s");
}

TEST_F(FetcherTest, NamesAndHostsThatAreNotThere) {
  FetchOptions options = Options();
  options.hosts = {"nowhere.invalid", "127.0.0.1:9"};
  ExpectProblem(options, "http://nowhere.invalid/", "fetch_failed", "cannot be resolved");
  ExpectProblem(options, "http://127.0.0.1:9/", "fetch_failed", "cannot be reached");
}

TEST_F(FetcherTest, EndsWhenItIsToldTo) {
  FetchOptions options = Options();
  options.timeout = std::chrono::seconds(60);
  for (const bool by_caller : {false, true}) {
    Fetcher fetcher(options);
    std::atomic<bool> stop{false};
    const int before = other_.connections();
    auto code = std::async(std::launch::async, [&] {
      try {
        fetcher.Fetch(other_.url("/silent"), Fetcher::For::kJob, [&] { return stop.load(); });
      } catch (...) {
        return server::CurrentProblem().code;
      }
      return std::string();
    });
    while (other_.connections() == before) std::this_thread::yield();
    if (by_caller) {
      stop = true;
    } else {
      fetcher.Stop();
    }
    ASSERT_EQ(code.wait_for(std::chrono::seconds(10)), std::future_status::ready);
    EXPECT_EQ(code.get(), "stopping");
    if (!by_caller) {
      EXPECT_EQ(ProblemOf(fetcher, other_.url("/")).code, "stopping");
    }
  }
}

TEST_F(FetcherTest, NoMoreImagesAtOnceThanItMay) {
  FetchOptions options = Options();
  options.most_at_once = 2;
  options.timeout = std::chrono::milliseconds(1'000);
  Fetcher fetcher(options);
  std::optional<server::FetchedImage> first = fetcher.Fetch(other_.url("/"));
  const server::FetchedImage second = fetcher.Fetch(other_.url("/"));
  const Problem busy = ProblemOf(fetcher, other_.url("/"));
  EXPECT_EQ(busy.code, "busy");
  EXPECT_EQ(busy.retry_after_s, 2);
  const auto begin = Clock::now();
  EXPECT_EQ(ProblemOf(fetcher, other_.url("/"), Fetcher::For::kBatch).code, "busy");
  EXPECT_GE(Clock::now() - begin, std::chrono::milliseconds(900)) << "a batch waits";
  first.reset();
  EXPECT_NO_THROW(fetcher.Fetch(other_.url("/")));
  // A job leaves half of the places to the others, and waits until it is stopped.
  const Problem stopped = [&] {
    try {
      fetcher.Fetch(other_.url("/"), Fetcher::For::kJob,
                    [&, polls = 0]() mutable { return ++polls > 15; });
    } catch (...) {
      return server::CurrentProblem();
    }
    return Problem();
  }();
  EXPECT_EQ(stopped.code, "stopping");
  EXPECT_EQ(std::string(second.bytes->begin(), second.bytes->end()), kImage);
}

TEST_F(FetcherTest, CertificatesAreVerified) {
  const TemporaryFolder folder;
  const std::string certificate = (folder / "cert.pem").string();
  WriteCertificate(certificate, folder / "key.pem", false, "DNS:images.test");
  httplib::SSLServer tls(certificate.c_str(), (folder / "key.pem").c_str());
  std::string port;  // before anybody asks
  tls.Get("/image", [&](const httplib::Request& request, httplib::Response& answer) {
    EXPECT_EQ(request.get_header_value("Host"), "images.test:" + port);
    answer.set_content(kImage, "image/png");
  });
  tls.Get("/down", [&](const httplib::Request&, httplib::Response& answer) {
    answer.set_redirect(other_.url("/"));
  });
  port = std::to_string(tls.bind_to_any_port("127.0.0.1"));
  std::thread serving([&] { tls.listen_after_bind(); });
  FetchOptions options = Options();
  options.hosts = {"*.test:" + port, other_.host()};
  options.resolve = {"images.test:" + port + ":127.0.0.1", "wrong.test:" + port + ":127.0.0.1"};
  const std::string url = "https://images.test:" + port + "/image";
  ExpectProblem(options, url, "fetch_failed",
                "certificate of the host of image_url is not trusted");
  options.ca_file = certificate;
  EXPECT_EQ(Fetched(options, url), kImage);
  ExpectProblem(options, "https://wrong.test:" + port + "/image", "fetch_failed",
                "certificate of the host of image_url is not trusted");
  ExpectProblem(options, "https://images.test:" + port + "/down", "fetch_failed",
                "from https to http");
  EXPECT_EQ(other_.connections(), 0);
  tls.stop();
  serving.join();
}

}  // namespace
}  // namespace pliant::testing
