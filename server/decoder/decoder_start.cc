// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/decoder/decoder_start.h"

#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/decoder/sandbox.h"
#include "server/decoder/wire.h"

namespace pliant::server {

namespace {

[[noreturn]] void ThrowNotStarted(const std::string& what, int error) {
  throw Error(ErrorCode::kUnavailable, "decoder_not_started",
              "a decoder cannot be started: " + what + ": " + std::strerror(error));
}

// What is open in it, and which signals it hears.
class SpawnPlan {
 public:
  explicit SpawnPlan(int socket) {
    posix_spawn_file_actions_init(&actions_);
    posix_spawnattr_init(&attributes_);
    Check(posix_spawn_file_actions_adddup2(&actions_, socket, kDecoderSocket));
    OpenNull(STDIN_FILENO, O_RDONLY);
    OpenNull(STDOUT_FILENO, O_WRONLY);
    if (!kSanitized) OpenNull(STDERR_FILENO, O_WRONLY);  // else what a sanitizer finds is lost
    Check(posix_spawn_file_actions_addclosefrom_np(&actions_, kDecoderSocket + 1));
    sigset_t blocked;
    sigemptyset(&blocked);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&blocked, signal);
    Check(posix_spawnattr_setsigmask(&attributes_, &blocked));
    sigset_t usual;
    sigemptyset(&usual);
    sigaddset(&usual, SIGPIPE);
    Check(posix_spawnattr_setsigdefault(&attributes_, &usual));
    Check(posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF));
  }
  ~SpawnPlan() {
    posix_spawn_file_actions_destroy(&actions_);
    posix_spawnattr_destroy(&attributes_);
  }
  SpawnPlan(const SpawnPlan&) = delete;
  SpawnPlan& operator=(const SpawnPlan&) = delete;

  const posix_spawn_file_actions_t* actions() const { return &actions_; }
  const posix_spawnattr_t* attributes() const { return &attributes_; }

 private:
  void OpenNull(int file, int mode) {
    Check(posix_spawn_file_actions_addopen(&actions_, file, "/dev/null", mode, 0));
  }
  static void Check(int error) {
    if (error != 0) ThrowNotStarted("posix_spawn", error);
  }

  posix_spawn_file_actions_t actions_{};
  posix_spawnattr_t attributes_{};
};

// Libraries start no threads; where they lie, if not at their usual places; and what a sanitizer is
// told. No more: the server's environment may hold secrets.
std::vector<std::string> Environment() {
  std::vector<std::string> environment = {"OMP_NUM_THREADS=1", "OPENBLAS_NUM_THREADS=1"};
  for (const char* name :
       {"LD_LIBRARY_PATH", "ASAN_OPTIONS", "LSAN_OPTIONS", "TSAN_OPTIONS", "UBSAN_OPTIONS"}) {
    const char* value = std::getenv(name);
    if (value != nullptr) environment.push_back(std::string(name) + "=" + value);
  }
  return environment;
}

std::vector<char*> Pointers(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

// Enough for the picture during which it comes to be worn.
std::int64_t CpuLimit(const DecoderOptions& options) {
  const auto whole = std::chrono::ceil<std::chrono::seconds>(options.worn_after + options.timeout);
  return whole.count();
}

}  // namespace

StartedDecoder StartDecoder(const DecoderOptions& options) {
  struct Ends {  // closed again, whatever is thrown
    ~Ends() {
      for (const int end : both) {
        if (end >= 0) close(end);
      }
    }
    int both[2] = {-1, -1};
  } pair;
  int* const ends = pair.both;
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    ThrowNotStarted("socketpair", errno);
  }
  StartedDecoder started;
  int error = 0;
  {
    const SpawnPlan plan(ends[1]);
    std::vector<std::string> arguments = {
        "pliant-server", kDecoderArgument, std::to_string(getpid()),
        std::to_string(options.memory_bytes), std::to_string(CpuLimit(options))};
    std::vector<std::string> environment = Environment();
    error = fcntl(ends[0], F_SETFL, O_NONBLOCK) == 0 ? 0 : errno;
    if (error == 0) {
      error = posix_spawn(&started.id, options.program.c_str(), plan.actions(), plan.attributes(),
                          Pointers(arguments).data(), Pointers(environment).data());
    }
  }
  if (error != 0) ThrowNotStarted(options.program.string(), error);
  started.socket = std::exchange(ends[0], -1);
  return started;
}

}  // namespace pliant::server
