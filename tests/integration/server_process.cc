// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/server_process.h"

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <map>
#include <random>
#include <sstream>
#include <stdexcept>

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "descriptor/image/image.h"

namespace pliant::testing {

namespace {

constexpr std::chrono::seconds kStartTimeout{60};
constexpr int kDripMs = 100;

void SendAll(int fd, const std::string& bytes) {
  std::size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t n = send(fd, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) return;  // the server has closed: what it said before can still be read
    sent += static_cast<std::size_t>(n);
  }
}

std::vector<std::string> CommandLine(const std::filesystem::path& database,
                                     const std::vector<std::string>& flags) {
  std::vector<std::string> arguments = {"--db",        DatabaseOf(database), "--listen",
                                        "127.0.0.1:0", "--descriptor",       "rootsift"};
  arguments.insert(arguments.end(), flags.begin(), flags.end());
  return arguments;
}

}  // namespace

std::filesystem::path ServerPath() {
  return std::filesystem::path(PLIANT_BINARY_DIR) / "bin" / "pliant-server";
}

std::string DatabaseOf(const std::filesystem::path& file) {
  const char* test_database = std::getenv("PLIANT_TEST_DATABASE");
  if (test_database == nullptr) return file.string();
  static std::map<std::filesystem::path, std::string> made;
  std::string& url = made[file];
  if (!url.empty()) return url;
  const std::string schema = "test_" + std::to_string(getpid()) + "_" + std::to_string(made.size());
  const std::string base = test_database;
  const ProgramResult done =
      Program({base, "-c", "CREATE SCHEMA \"" + schema + "\""}, {}, "/usr/bin/psql").Wait();
  if (done.status != 0) throw std::runtime_error("psql: " + done.err);
  const char* separator = base.find('?') == std::string::npos ? "?" : "&";
  url = base + separator + "options=-csearch_path%3D" + schema;
  return url;
}

ServerProcess::ServerProcess(const std::filesystem::path& database,
                             const std::vector<std::string>& flags)
    : program_(CommandLine(database, flags), {}, ServerPath()) {
  const auto deadline = std::chrono::steady_clock::now() + kStartTimeout;
  std::string said;
  while ((said = program_.Out()).find('\n') == std::string::npos) {
    if (!program_.IsRunning() || std::chrono::steady_clock::now() > deadline) {
      throw std::runtime_error("the server did not start: " + Log());
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  const std::string host = "://127.0.0.1:";
  const std::size_t at = said.find(host);
  if (!said.starts_with("listening on http") || at == std::string::npos) {
    throw std::runtime_error("unexpected: " + said);
  }
  port_ = std::stoi(said.substr(at + host.size()));
}

void ServerProcess::LimitFiles(std::uint64_t bytes) const {
  const rlimit limit{bytes, RLIM_INFINITY};
  if (prlimit(program_.id(), RLIMIT_FSIZE, &limit, nullptr) != 0) {
    throw std::runtime_error("the server's files cannot be limited");
  }
}

int ServerProcess::Stop() {
  Signal(SIGTERM);
  return Wait();
}

httplib::Client ServerProcess::Client() const {
  httplib::Client client("127.0.0.1", port_);
  client.set_keep_alive(true);
  client.set_tcp_nodelay(true);
  client.set_read_timeout(60);
  return client;
}

std::string ServerProcess::Talk(const std::string& bytes, std::chrono::milliseconds patience,
                                bool drip) const {
  const int fd = Open(bytes);
  std::string answer;
  auto last = std::chrono::steady_clock::now();
  pollfd readable = {fd, POLLIN, 0};
  while (fd >= 0 && std::chrono::steady_clock::now() - last < patience) {
    if (poll(&readable, 1, kDripMs) == 0) {
      if (drip) SendAll(fd, "x");
      continue;
    }
    char buffer[4096];
    const ssize_t n = recv(fd, buffer, sizeof(buffer), 0);
    if (n <= 0) break;
    answer.append(buffer, static_cast<std::size_t>(n));
    last = std::chrono::steady_clock::now();
  }
  if (fd >= 0) close(fd);
  return answer;
}

int ServerProcess::Open(const std::string& bytes) const {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port_));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    close(fd);
    return -1;
  }
  SendAll(fd, bytes);
  return fd;
}

double Metric(httplib::Client& client, const std::string& name) {
  const auto answer = client.Get("/metrics");
  if (!answer || answer->status != 200) throw std::runtime_error("/metrics has no answer");
  const std::string& text = answer->body;
  const std::size_t at = text.find("\n" + name + " ");
  if (at == std::string::npos) throw std::runtime_error("there is no metric " + name);
  return std::stod(text.substr(at + name.size() + 2));
}

std::string TestImage(std::uint64_t object_seed, int view, int width, int height) {
  Image image{width, height, 1,
              std::vector<std::uint8_t>(static_cast<std::size_t>(width) * height, 128)};
  std::mt19937_64 random(object_seed * 7919 + 17);
  std::uniform_real_distribution<double> unit(0, 1);
  const double angle = 0.15 * view;
  const double scale = 1 - 0.06 * view;
  const int blobs = 90 * width / 320;
  for (int i = 0; i < blobs; ++i) {
    const double x0 = (unit(random) - 0.5) * width;
    const double y0 = (unit(random) - 0.5) * height;
    const double radius = scale * (3 + 9 * unit(random));
    const auto grey = static_cast<std::uint8_t>(255 * unit(random));
    const double x = width / 2.0 + scale * (std::cos(angle) * x0 - std::sin(angle) * y0);
    const double y = height / 2.0 + scale * (std::sin(angle) * x0 + std::cos(angle) * y0);
    for (int py = std::max(0, static_cast<int>(y - radius));
         py <= std::min(height - 1, static_cast<int>(y + radius)); ++py) {
      for (int px = std::max(0, static_cast<int>(x - radius));
           px <= std::min(width - 1, static_cast<int>(x + radius)); ++px) {
        if (std::hypot(px - x, py - y) <= radius) {
          image.pixels[static_cast<std::size_t>(py) * width + px] = grey;
        }
      }
    }
  }
  const std::vector<std::uint8_t> png = EncodePng(image);
  return {png.begin(), png.end()};
}

}  // namespace pliant::testing
