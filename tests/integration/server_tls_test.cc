// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// TLS: certificates, ciphers, how connections begin and end.
#include <array>
#include <cstdio>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <unistd.h>

#include "tests/integration/certificate.h"
#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kImages = "/v1/collections/default/images";

class TlsTest : public ::testing::Test {
 protected:
  std::filesystem::path database() const { return folder_.path() / "test.db"; }
  TemporaryFolder folder_;
};

TEST_F(TlsTest, SpeaksTls) {
  WriteCertificate(folder_ / "cert.pem", folder_ / "key.pem");
  ServerProcess server(database(), {"--tls-cert", (folder_ / "cert.pem").string(), "--tls-key",
                                    (folder_ / "key.pem").string(), "--header-timeout", "1",
                                    "--idle-timeout", "1", "--auto-train", "false"});
  httplib::SSLClient client("127.0.0.1", server.port());
  client.set_ca_cert_path((folder_ / "cert.pem").string());
  client.enable_server_certificate_verification(true);
  client.set_keep_alive(true);
  const std::string image = TestImage(1, 0, 1200, 900);
  const auto made = client.Post(kImages, image, "image/png");
  ASSERT_TRUE(made) << httplib::to_string(made.error());
  ASSERT_EQ(made->status, 201) << made->body;
  EXPECT_THAT(made->get_header_value("Strict-Transport-Security"), HasSubstr("max-age="));
  const auto content = client.Get(made->get_header_value("Location") + "/content");
  ASSERT_TRUE(content);
  EXPECT_EQ(content->body, image);
  for (int i = 0; i < 20; ++i) ASSERT_EQ(client.Get("/livez")->status, 200);
  EXPECT_EQ(client.Post(kImages, std::string(1000, 'x'), "image/png")->status, 415);

  // Somebody who does not speak it, and somebody who says nothing, are let go.
  EXPECT_THAT(server.Talk("GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n"), Not(HasSubstr("200")));
  const auto start = std::chrono::steady_clock::now();
  server.Talk("", std::chrono::milliseconds(10'000));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(8));
  EXPECT_EQ(client.Get("/livez")->status, 200);
  EXPECT_EQ(server.Stop(), 0) << server.Log();
}

// A connection without verification, which shows how its end looks to OpenSSL.
class TlsTalk {
 public:
  explicit TlsTalk(int port)
      : context_(SSL_CTX_new(TLS_client_method()), SSL_CTX_free),
        connection_(BIO_new_ssl_connect(context_.get()), BIO_free_all) {
    BIO_set_conn_hostname(connection_.get(), ("127.0.0.1:" + std::to_string(port)).c_str());
    BIO_get_ssl(connection_.get(), &ssl_);
    EXPECT_GT(BIO_do_connect(connection_.get()), 0);
  }

  void Send(const std::string& bytes) {
    EXPECT_EQ(SSL_write(ssl_, bytes.data(), static_cast<int>(bytes.size())),
              static_cast<int>(bytes.size()));
  }

  // Says that nothing more is sent.
  void End() { EXPECT_EQ(SSL_shutdown(ssl_), 0); }

  // Reads up to the end. SSL_ERROR_ZERO_RETURN: the server said that it is the end
  // (close_notify); anything else: the connection was merely cut off.
  int AwaitEnd() {
    std::array<char, 4096> buffer{};
    int got = 0;
    while ((got = SSL_read(ssl_, buffer.data(), static_cast<int>(buffer.size()))) > 0) {
      answer_.append(buffer.data(), static_cast<std::size_t>(got));
    }
    return SSL_get_error(ssl_, got);
  }

  const std::string& answer() const { return answer_; }

 private:
  std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context_;
  std::unique_ptr<BIO, decltype(&BIO_free_all)> connection_;
  SSL* ssl_ = nullptr;  // owned by connection_
  std::string answer_;
};

TEST_F(TlsTest, TlsConnectionsThatHaveAnEndSaySo) {
  WriteCertificate(folder_ / "cert.pem", folder_ / "key.pem");
  const ServerProcess server(database(),
                             {"--tls-cert", (folder_ / "cert.pem").string(), "--tls-key",
                              (folder_ / "key.pem").string(), "--auto-train", "false"});
  const std::string host = "Host: localhost\r\n";
  const std::string one = "GET /livez HTTP/1.1\r\n" + host + "\r\n";
  std::string many;  // as many as a connection carries
  for (int i = 0; i < 1000; ++i) many += one;
  const std::string refused = "POST " + std::string(kImages) + " HTTP/1.1\r\n" + host;
  for (const auto& [end, request] :
       {std::pair{"asked for", "GET /livez HTTP/1.1\r\n" + host + "Connection: close\r\n\r\n"},
        std::pair{"of HTTP/1.0", std::string("GET /livez HTTP/1.0\r\n\r\n")},
        std::pair{"of the count", many},
        std::pair{"of a refused body", refused + "Content-Length: 9999999999\r\n\r\n"},
        std::pair{"of nonsense", "GET /" + std::string(100'000, 'x')}}) {
    TlsTalk talk(server.port());
    talk.Send(request);
    EXPECT_EQ(talk.AwaitEnd(), SSL_ERROR_ZERO_RETURN) << end;
    EXPECT_THAT(talk.answer(), HasSubstr("HTTP/1.1 ")) << end;
  }

  TlsTalk first(server.port());
  first.Send(one);
  first.End();
  EXPECT_EQ(first.AwaitEnd(), SSL_ERROR_ZERO_RETURN);
  EXPECT_THAT(first.answer(), HasSubstr("200 OK"));

  TlsTalk silent(server.port());
  silent.End();
  EXPECT_EQ(silent.AwaitEnd(), SSL_ERROR_ZERO_RETURN);
}

// Clients that connect and do not greet hold nothing that others need.
TEST_F(TlsTest, SilentTlsClientsHoldNoThread) {
  WriteCertificate(folder_ / "cert.pem", folder_ / "key.pem");
  const ServerProcess server(
      database(),
      {"--tls-cert", (folder_ / "cert.pem").string(), "--tls-key", (folder_ / "key.pem").string(),
       "--auto-train", "false", "--http-threads", "2", "--header-timeout", "60"});
  std::vector<int> sockets;
  for (int i = 0; i < 100; ++i) {
    sockets.push_back(server.Open(i % 2 == 0 ? "" : "\x16\x03\x01"));  // nothing, half a greeting
    ASSERT_GE(sockets.back(), 0);
  }
  const auto start = std::chrono::steady_clock::now();
  TlsTalk talk(server.port());
  talk.Send("GET /livez HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  talk.AwaitEnd();
  EXPECT_THAT(talk.answer(), HasSubstr("200 OK"));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
  for (const int fd : sockets) close(fd);
}

// With a key exchange by the certificate's own key, whoever gets hold of that can read all that was
// ever recorded.
TEST_F(TlsTest, EveryTlsCipherKeepsThePast) {
  WriteCertificate(folder_ / "cert.pem", folder_ / "key.pem", true);
  const ServerProcess server(database(),
                             {"--tls-cert", (folder_ / "cert.pem").string(), "--tls-key",
                              (folder_ / "key.pem").string(), "--auto-train", "false"});
  const std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context(SSL_CTX_new(TLS_client_method()),
                                                                  SSL_CTX_free);
  SSL_CTX_set_max_proto_version(context.get(), TLS1_2_VERSION);
  for (const auto& [ciphers, accepted] : {std::pair{"kRSA", 0}, std::pair{"ECDHE", 1}}) {
    ASSERT_EQ(SSL_CTX_set_cipher_list(context.get(), ciphers), 1);
    const std::unique_ptr<BIO, decltype(&BIO_free_all)> connection(
        BIO_new_ssl_connect(context.get()), BIO_free_all);
    BIO_set_conn_hostname(connection.get(), ("127.0.0.1:" + std::to_string(server.port())).c_str());
    EXPECT_EQ(BIO_do_connect(connection.get()) > 0 ? 1 : 0, accepted) << ciphers;
  }
}

TEST_F(TlsTest, TlsFilesThatDoNotFitAreNamed) {
  WriteCertificate(folder_ / "cert.pem", folder_ / "key.pem");
  WriteCertificate(folder_ / "other.pem", folder_ / "other-key.pem");
  const auto start = [&](const std::string& certificate, const std::string& key) {
    return Program({"--db", database().string(), "--descriptor", "rootsift", "--listen",
                    "127.0.0.1:0", "--tls-cert", (folder_ / certificate).string(), "--tls-key",
                    (folder_ / key).string()},
                   {}, ServerPath())
        .Wait();
  };
  EXPECT_THAT(start("none.pem", "key.pem").err,
              AllOf(HasSubstr("--tls-cert"), HasSubstr("No such file")));
  EXPECT_THAT(start("key.pem", "key.pem").err,
              AllOf(HasSubstr("key.pem holds no certificate"), Not(HasSubstr("error:"))));
  const ProgramResult mixed = start("cert.pem", "other-key.pem");
  EXPECT_EQ(mixed.status, 2);
  EXPECT_THAT(mixed.err, HasSubstr("--tls-key"));
}

}  // namespace
}  // namespace pliant::testing
