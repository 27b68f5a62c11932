// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a process can still do in the sandbox of a decoder, each tried in a child of its own.
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "server/decoder/sandbox.h"

namespace pliant::server {
namespace {

constexpr std::int64_t kMiB = std::int64_t{1} << 20;
constexpr std::int64_t kMemory = 64 * kMiB;
constexpr SandboxLimits kLimits{.memory_bytes = kMemory, .cpu_s = 2};
constexpr int kNotLimited = 99;
constexpr int kNoSocket = 98;

// "left N" or "signal N", of a child that enters the sandbox and then does it.
std::string InSandbox(const std::function<int(int socket)>& act,
                      const std::function<void()>& before = {}) {
  const pid_t child = fork();
  if (child == 0) {
    if (before) before();
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0) _exit(kNoSocket);
    const bool limited = EnterSandbox(ends[0], kLimits).empty();
    if (!limited && !before) _exit(kNotLimited);
    _exit(act(ends[0]));
  }
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? "left " + std::to_string(WEXITSTATUS(status))
                           : "signal " + std::to_string(WTERMSIG(status));
}

struct Attempt {
  const char* name;
  std::function<int(int socket)> act;
};

void PrintTo(const Attempt& attempt, std::ostream* out) { *out << attempt.name; }

// A sanitizer takes terabytes of addresses and calls that the filter forbids, so its build has
// none.
class Sandbox : public ::testing::Test {
 protected:
  void SetUp() override {
    if (kSanitized) GTEST_SKIP() << "builds with a sanitizer have no sandbox (sandbox.h)";
  }
};

class Forbidden : public Sandbox, public ::testing::WithParamInterface<Attempt> {};

TEST_P(Forbidden, EndsTheProcess) {
  EXPECT_EQ(InSandbox(GetParam().act), "signal " + std::to_string(SIGSYS));
}

const std::vector<Attempt>& Attempts() {
  static const std::vector<Attempt> attempts = {
      {"open", [](int) { return open("/etc/passwd", O_RDONLY | O_CLOEXEC); }},
      {"create", [](int) { return open("/tmp/x", O_CREAT | O_WRONLY | O_CLOEXEC, 0600); }},
      {"unlink", [](int) { return unlink("/tmp/x"); }},
      {"socket", [](int) { return socket(AF_INET, SOCK_STREAM, 0); }},
      {"memfd", [](int) { return static_cast<int>(syscall(SYS_memfd_create, "x", 0)); }},
      {"execve", [](int) { return execl("/bin/true", "true", nullptr); }},
      {"fork", [](int) { return static_cast<int>(fork()); }},
      {"kill", [](int) { return kill(getppid(), 0); }},
      {"ptrace", [](int) { return static_cast<int>(syscall(SYS_ptrace, 0, 0, 0, 0)); }},
      {"prctl", [](int) { return prctl(PR_SET_DUMPABLE, 1, 0, 0, 0); }},
      {"raise_limit",
       [](int) {
         const rlimit none{RLIM_INFINITY, RLIM_INFINITY};
         return setrlimit(RLIMIT_AS, &none);
       }},
      {"pass_a_file",
       [](int socket) {
         msghdr message{};
         return static_cast<int>(sendmsg(socket, &message, 0));
       }},
      {"read_another",
       [](int socket) {
         char byte = 0;
         return static_cast<int>(read(socket + 1, &byte, 1));
       }},
      {"write_another", [](int socket) { return static_cast<int>(write(socket + 1, "x", 1)); }},
      {"executable_memory",
       [](int) {
         return mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS,
                     -1, 0) == MAP_FAILED;
       }},
      {"make_executable",
       [](int) {
         void* page =
             mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
         return mprotect(page, 4096, PROT_READ | PROT_EXEC);
       }},
      {"map_a_file", [](int socket) {
         return mmap(nullptr, 4096, PROT_READ, MAP_PRIVATE, socket, 0) == MAP_FAILED;
       }}};
  return attempts;
}

INSTANTIATE_TEST_SUITE_P(Calls, Forbidden, ::testing::ValuesIn(Attempts()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_F(Sandbox, ReadsAndWritesItsSocket) {
  const auto talk = [](int socket) {
    // To the other end, which nobody reads, and nothing comes from there.
    if (write(socket, "x", 1) != 1) return 1;
    std::vector<char> memory(8 * kMiB, 'x');
    return memory[memory.size() / 2] == 'x' ? 0 : 2;
  };
  EXPECT_EQ(InSandbox(talk), "left 0");
}

// libde265 (HEIC) starts one.
TEST_F(Sandbox, CanStartThreadsButNoProcesses) {
  const auto start = [](int) {
    int result = 1;
    std::thread([&] { result = 0; }).join();
    return result;
  };
  EXPECT_EQ(InSandbox(start), "left 0");
}

TEST_F(Sandbox, HasNoMoreMemoryThanAllowed) {
  const auto take = [](std::int64_t bytes) {
    return [bytes](int) {
      return mmap(nullptr, static_cast<std::size_t>(bytes), PROT_READ | PROT_WRITE,
                  MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED
                 ? errno
                 : 0;
    };
  };
  EXPECT_EQ(InSandbox(take(kMemory / 2)), "left 0");
  EXPECT_EQ(InSandbox(take(kMemory * 2)), "left " + std::to_string(ENOMEM));
}

TEST_F(Sandbox, HasNoMoreTimeThanAllowed) {
  volatile int turns = 0;
  EXPECT_EQ(InSandbox([&](int) -> int {
              for (;;) turns = turns + 1;
            }),
            "signal " + std::to_string(SIGKILL));
}

TEST_F(Sandbox, ADamagedHeapIsReportedAsSuch) {
  EXPECT_EQ(InSandbox([](int) -> int { std::abort(); }), "signal " + std::to_string(SIGABRT));
}

// As in containers of old: filters may not be installed.
void ForbidFilters() {
  scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
  seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(seccomp), 0);
  seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(prctl), 1,
                   SCMP_A0(SCMP_CMP_EQ, PR_SET_SECCOMP));
  if (seccomp_load(filter) != 0) _exit(kNotLimited);
  seccomp_release(filter);
}

TEST_F(Sandbox, WithoutAFilterTheOtherLimitsHold) {
  const auto look = [](int socket) {
    rlimit memory{};
    rlimit files{};
    getrlimit(RLIMIT_AS, &memory);
    getrlimit(RLIMIT_NOFILE, &files);
    if (memory.rlim_max == RLIM_INFINITY) return 1;
    if (files.rlim_max != static_cast<rlim_t>(socket) + 1) return 2;
    if (prctl(PR_GET_NO_NEW_PRIVS, 0, 0, 0, 0) != 1) return 3;
    if (prctl(PR_GET_DUMPABLE, 0, 0, 0, 0) != 0) return 4;
    return 0;
  };
  EXPECT_EQ(InSandbox(look, ForbidFilters), "left 0");
  const auto says_so = [] {
    ForbidFilters();
    _exit(EnterSandbox(STDERR_FILENO, kLimits).starts_with("seccomp: ") ? 7 : 8);
  };
  EXPECT_EQ(InSandbox([](int) { return 0; }, says_so), "left 7");
}

}  // namespace
}  // namespace pliant::server
