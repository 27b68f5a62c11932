// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/program.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/capability.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace pliant::testing {
namespace {

std::string ReadText(const std::filesystem::path& path) {
  const std::vector<std::uint8_t> bytes = ReadBytes(path);
  return {bytes.begin(), bytes.end()};
}

// In the child: nothing here may allocate.
[[noreturn]] void Become(const char* path, char* const* arguments, const ProgramLimits& limits,
                         int out, int err) {
  ::dup2(out, STDOUT_FILENO);
  ::dup2(err, STDERR_FILENO);
  const int nothing = ::open("/dev/null", O_RDONLY);
  ::dup2(nothing, STDIN_FILENO);
  if (limits.max_file_bytes != 0) {
    const rlimit limit{limits.max_file_bytes, limits.max_file_bytes};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  if (limits.max_open_files != 0) {
    const rlimit limit{limits.max_open_files, limits.max_open_files};
    ::setrlimit(RLIMIT_NOFILE, &limit);
  }
  if (limits.unprivileged && ::getuid() == 0) {
    for (const int capability : {CAP_SYS_RESOURCE, CAP_DAC_OVERRIDE}) {
      if (::prctl(PR_CAPBSET_DROP, capability) != 0) ::_exit(126);
    }
  }
  ::execv(path, arguments);
  ::_exit(127);
}

}  // namespace

std::filesystem::path PliantPath() {
  return std::filesystem::path(PLIANT_BINARY_DIR) / "bin" / "pliant";
}

Program::Program(const std::vector<std::string>& arguments, const ProgramLimits& limits,
                 const std::filesystem::path& path) {
  const std::string program = (path.empty() ? PliantPath() : path).string();
  std::vector<std::string> all = {program};
  all.insert(all.end(), arguments.begin(), arguments.end());
  std::vector<char*> raw;
  for (std::string& argument : all) raw.push_back(argument.data());
  raw.push_back(nullptr);
  const int flags = O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC;
  const int out = ::open((folder_ / "out").c_str(), flags, 0666);
  const int err = ::open((folder_ / "err").c_str(), flags, 0666);
  pid_ = ::fork();
  if (pid_ == 0) Become(program.c_str(), raw.data(), limits, out, err);
  ::close(out);
  ::close(err);
}

Program::~Program() {
  if (ended_ || pid_ <= 0) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, &wait_status_, 0);
}

void Program::Signal(int number) const {
  if (!ended_) ::kill(pid_, number);
}

bool Program::IsRunning() {
  if (!ended_ && ::waitpid(pid_, &wait_status_, WNOHANG) == pid_) ended_ = true;
  return !ended_;
}

ProgramResult Program::Wait() {
  if (!ended_) {
    EXPECT_EQ(::waitpid(pid_, &wait_status_, 0), pid_);
    ended_ = true;
  }
  ProgramResult result;
  result.status =
      WIFEXITED(wait_status_) ? WEXITSTATUS(wait_status_) : 128 + WTERMSIG(wait_status_);
  result.out = Out();
  result.err = Err();
  return result;
}

std::string Program::Out() const { return ReadText(folder_ / "out"); }

std::string Program::Err() const { return ReadText(folder_ / "err"); }

}  // namespace pliant::testing
