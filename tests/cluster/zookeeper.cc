// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/cluster/zookeeper.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace pliant::testing {
namespace {

using std::chrono::milliseconds;

constexpr const char* kJava = "/usr/bin/java";
constexpr const char* kJar = "/usr/share/java/zookeeper.jar";

sockaddr_in Loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  return address;
}

int Socket() { return socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0); }

int Listen(int& port) {
  const int listener = Socket();
  sockaddr_in address = Loopback(0);
  socklen_t length = sizeof(address);
  auto* plain = reinterpret_cast<sockaddr*>(&address);
  if (bind(listener, plain, length) != 0 || listen(listener, 64) != 0 ||
      getsockname(listener, plain, &length) != 0) {
    throw std::runtime_error("there is no free port");
  }
  port = ntohs(address.sin_port);
  return listener;
}

int Connect(int port) {
  const int fd = Socket();
  const sockaddr_in address = Loopback(port);
  if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) return fd;
  close(fd);
  return -1;
}

bool Readable(int fd, int ms) {
  pollfd waiting = {fd, POLLIN, 0};
  return poll(&waiting, 1, ms) > 0;
}

// Empty: it was closed.
std::string Receive(int fd) {
  char buffer[16384];
  const ssize_t got = recv(fd, buffer, sizeof(buffer), 0);
  return got > 0 ? std::string(buffer, static_cast<std::size_t>(got)) : std::string();
}

}  // namespace

std::string MissingForZooKeeper() {
  if (!std::filesystem::exists(kJar)) return "libzookeeper-java";
  return std::filesystem::exists(kJava) ? "" : "default-jre-headless";
}

ZooKeeper::ZooKeeper() {
  close(Listen(port_));
  std::filesystem::create_directory(folder_ / "data");
  std::ofstream(folder_ / "zoo.cfg")
      << "tickTime=500\ndataDir=" << (folder_ / "data").string() << "\nclientPort=" << port_
      << "\nclientPortAddress=127.0.0.1\nadmin.enableServer=false\n"
         "maxClientCnxns=0\n4lw.commands.whitelist=srvr,wchs\n";
  Start();
}

void ZooKeeper::Start() {
  program_ = std::make_unique<Program>(
      std::vector<std::string>{
          "-Xmx128m", "-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1", "-cp",
          std::string("/etc/zookeeper/conf_example:") + kJar,
          "-Dzookeeper.log.dir=" + folder_.path().string(), "-Dzookeeper.root.logger=WARN,CONSOLE",
          "org.apache.zookeeper.server.quorum.QuorumPeerMain", (folder_ / "zoo.cfg").string()},
      ProgramLimits{}, kJava);
  for (int i = 0; i < 600; ++i) {
    if (Ask("srvr").find("Mode:") != std::string::npos) return;
    if (!program_->IsRunning()) break;
    std::this_thread::sleep_for(milliseconds(100));
  }
  throw std::runtime_error("ZooKeeper does not answer: " + program_->Out() + program_->Err());
}

std::string ZooKeeper::Ask(const std::string& word) const {
  const int fd = Connect(port_);
  if (fd < 0) return "";
  std::string answer;
  send(fd, word.data(), word.size(), MSG_NOSIGNAL);
  while (Readable(fd, 2000)) {
    const std::string piece = Receive(fd);
    if (piece.empty()) break;
    answer += piece;
  }
  close(fd);
  return answer;
}

Wire::Wire(int to_port, std::function<bool(bool, const std::string&)> lets_pass)
    : to_port_(to_port), lets_pass_(std::move(lets_pass)), listener_(Listen(port_)) {
  accepting_ = std::thread([this] { Accept(); });
}

Wire::~Wire() {
  ending_ = true;
  accepting_.join();
  for (std::thread& connection : connections_) connection.join();
  close(listener_);
}

void Wire::Accept() {
  while (!ending_) {
    if (!Readable(listener_, 20)) continue;
    const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (client >= 0) connections_.emplace_back([this, client] { Serve(client); });
  }
}

void Wire::Serve(int client) {
  const int server = Connect(to_port_);
  bool open = server >= 0;
  while (open && !ending_) {
    pollfd both[] = {{client, POLLIN, 0}, {server, POLLIN, 0}};
    if (poll(both, 2, 20) <= 0) continue;
    for (int i = 0; i < 2 && open; ++i) {
      if (both[i].revents == 0) continue;
      const std::string bytes = Receive(both[i].fd);
      open = !bytes.empty() && lets_pass_(i == 0, bytes);
      if (open) send(i == 0 ? server : client, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    }
  }
  close(client);
  if (server >= 0) close(server);
}

SilentPort::SilentPort() : listener_(Listen(port_)) {}
SilentPort::~SilentPort() { close(listener_); }

clickhouse::KeeperOptions KeeperAt(int port) {
  return {.hosts = {{"127.0.0.1", port}},
          .root = "/pliant/test",
          .session_timeout = milliseconds(3000),
          .timeout = milliseconds(3000)};
}

}  // namespace pliant::testing
