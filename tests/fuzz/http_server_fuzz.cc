// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Conversations with a server on loopback: an input is all that a client sends, heads, queries,
// forms of several parts, chunked bodies.
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <string>
#include <thread>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/http/http_server.h"
#include "server/http/parameters.h"
#include "tests/fuzz/fuzz.h"

namespace {

using pliant::fuzz::Require;
using namespace pliant::server;  // NOLINT(google-build-using-namespace): this is about it

Response Echo(const Request& request, const Parameters& parameters) {
  std::size_t bytes = request.body.size();
  for (const Part& part : request.parts) bytes += part.content.size() + part.name.size();
  Require(request.parts.empty() || request.is_multipart(), "only forms have parts");
  return {200, "text/plain",
          std::to_string(bytes) + " bytes, object " + parameters.Text("object").value_or("none")};
}

Route MakeRoute(const char* name, const char* method, const char* pattern, BodyKind body) {
  return {.name = name,
          .method = method,
          .pattern = pattern,
          .scope = Scope::kPublic,
          .body = body,
          .parameters = {Parameter("object", ""), Parameter("limit", "").Integer(1, 9),
                         Parameter("metadata", "").Json()},
          .handler = Echo};
}

void CheckRecord(const RequestRecord& record) {
  Require(record.status >= 100 && record.status != 500 && record.status < 600,
          "no request is answered as a defect of the server");
  Require(record.internal.empty(), "no request makes an exception that nobody expects");
  Require(record.status < 400 || !record.code.empty(), "a problem has a code");
  Require(record.path.size() <= 256 && std::all_of(record.path.begin(), record.path.end(),
                                                   [](char c) { return c > ' ' && c <= '~'; }),
          "a path in the log is one word");
}

HttpOptions TestOptions() {
  HttpOptions options;
  options.port = 0;
  options.threads = 2;
  options.max_header_bytes = 2048;
  options.max_body_bytes = 8192;
  options.base_path = "/base";
  options.trusted_proxies = {"127.0.0.1"};
  options.allowed_origins = {"https://shop.example"};
  options.admit = [](const Route&, Request&) {};
  options.on_request = CheckRecord;
  return options;
}

HttpServer& TestServer() {
  static const Router kRouter({MakeRoute("get", "GET", "/x/{id}", BodyKind::kNone),
                               MakeRoute("json", "POST", "/x", BodyKind::kJson),
                               MakeRoute("form", "POST", "/form", BodyKind::kImageOrJson),
                               MakeRoute("pair", "PUT", "/form", BodyKind::kPair),
                               MakeRoute("delete", "DELETE", "/x/{id}", BodyKind::kNone)});
  static HttpServer server(kRouter, TestOptions());
  static const bool kStarted = (server.Start(), true);
  static_cast<void>(kStarted);
  return server;
}

// Ports are free again a second after their connection has ended.
int Connect(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  for (int attempt = 0; attempt < 1000; ++attempt) {
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    Require(fd >= 0, "there are sockets");
    if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) return fd;
    Require(errno == EADDRNOTAVAIL || errno == EINTR, "the server accepts connections");
    close(fd);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  Require(false, "the server accepts connections");
  return -1;
}

// Sends all and returns what comes back until the server ends the connection.
std::string Converse(int port, std::string_view text) {
  constexpr timeval kPatience{.tv_sec = 30, .tv_usec = 0};
  const int fd = Connect(port);
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof(kPatience));
  while (!text.empty()) {
    const ssize_t sent = send(fd, text.data(), text.size(), MSG_NOSIGNAL);
    if (sent <= 0) break;  // refused while it was sent
    text.remove_prefix(static_cast<std::size_t>(sent));
  }
  shutdown(fd, SHUT_WR);
  std::string answer;
  char buffer[4096];
  ssize_t got = 0;
  while ((got = recv(fd, buffer, sizeof(buffer), 0)) > 0) {
    answer.append(buffer, static_cast<std::size_t>(got));
  }
  Require(got == 0 || (errno != EAGAIN && errno != EWOULDBLOCK), "the server ends a conversation");
  close(fd);
  return answer;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string answer = Converse(TestServer().port(), pliant::fuzz::TextOf({data, size}));
  Require(answer.empty() || answer.starts_with("HTTP/1."), "an answer is HTTP");
  return 0;
}
