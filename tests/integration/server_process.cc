// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/server_process.h"

#include <cmath>
#include <csignal>
#include <fstream>
#include <random>
#include <sstream>
#include <stdexcept>

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "descriptor/image.h"

namespace pliant {

namespace {

constexpr int kStartTimeoutMs = 60'000;

pid_t Spawn(const std::vector<std::string>& command, int stdout_fd, int stderr_fd) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t pid = fork();
  if (pid < 0) throw std::runtime_error("fork failed");
  if (pid == 0) {
    dup2(stdout_fd, STDOUT_FILENO);
    dup2(stderr_fd, STDERR_FILENO);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  return pid;
}

ExitStatus WaitFor(pid_t pid) {
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status)) return {WEXITSTATUS(status), 0};
  return {-1, WIFSIGNALED(status) ? WTERMSIG(status) : 0};
}

std::string ReadFile(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "pliant-test-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("mkdtemp failed");
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

ExitStatus RunProgram(const std::vector<std::string>& command, std::string* output) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "output";
  const int fd = open(file.c_str(), O_CREAT | O_WRONLY | O_APPEND | O_CLOEXEC, 0600);
  const ExitStatus status = WaitFor(Spawn(command, fd, fd));
  close(fd);
  *output = ReadFile(file);
  return status;
}

ServerProcess::ServerProcess(const std::filesystem::path& database,
                             const std::vector<std::string>& flags)
    : log_(database.string() + ".log") {
  std::vector<std::string> command = {PLIANT_BINARY_DIR "/bin/pliant-server",
                                      "--db",
                                      database.string(),
                                      "--listen",
                                      "127.0.0.1:0",
                                      "--descriptor",
                                      "rootsift"};
  command.insert(command.end(), flags.begin(), flags.end());
  int pipe_fds[2];
  if (pipe2(pipe_fds, O_CLOEXEC) != 0) throw std::runtime_error("pipe failed");
  const int log_fd = open(log_.c_str(), O_CREAT | O_WRONLY | O_APPEND | O_CLOEXEC, 0600);
  pid_ = Spawn(command, pipe_fds[1], log_fd);
  close(pipe_fds[1]);
  close(log_fd);
  AwaitListening(pipe_fds[0]);
  close(pipe_fds[0]);
}

void ServerProcess::AwaitListening(int stdout_fd) {
  std::string said;
  pollfd fd = {stdout_fd, POLLIN, 0};
  while (said.find('\n') == std::string::npos) {
    char buffer[256];
    const bool ready = poll(&fd, 1, kStartTimeoutMs) > 0;
    const ssize_t got = ready ? read(stdout_fd, buffer, sizeof(buffer)) : 0;
    if (got <= 0) throw std::runtime_error("the server did not start: " + Log());
    said.append(buffer, static_cast<std::size_t>(got));
  }
  const std::string expected = "listening on http://127.0.0.1:";
  if (!said.starts_with(expected)) throw std::runtime_error("unexpected: " + said);
  port_ = std::stoi(said.substr(expected.size()));
}

ServerProcess::~ServerProcess() {
  if (pid_ < 0) return;
  Signal(SIGKILL);
  WaitFor(pid_);
}

httplib::Client ServerProcess::Client() const {
  httplib::Client client("127.0.0.1", port_);
  client.set_keep_alive(true);
  client.set_tcp_nodelay(true);
  client.set_read_timeout(60);
  return client;
}

void ServerProcess::Signal(int number) const { kill(pid_, number); }

ExitStatus ServerProcess::Wait() {
  const ExitStatus status = WaitFor(pid_);
  pid_ = -1;
  return status;
}

ExitStatus ServerProcess::Stop() {
  Signal(SIGTERM);
  return Wait();
}

std::string ServerProcess::Log() const { return ReadFile(log_); }

std::string ServerProcess::Talk(const std::string& bytes,
                                std::chrono::milliseconds patience) const {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port_));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  std::string answer;
  if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) {
    std::size_t sent = 0;
    while (sent < bytes.size()) {
      const ssize_t n = send(fd, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) break;
      sent += static_cast<std::size_t>(n);
    }
    pollfd readable = {fd, POLLIN, 0};
    char buffer[4096];
    while (poll(&readable, 1, static_cast<int>(patience.count())) > 0) {
      const ssize_t n = recv(fd, buffer, sizeof(buffer), 0);
      if (n <= 0) break;
      answer.append(buffer, static_cast<std::size_t>(n));
    }
  }
  close(fd);
  return answer;
}

std::string TestPicture(std::uint64_t object_seed, int view, int width, int height) {
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

}  // namespace pliant
