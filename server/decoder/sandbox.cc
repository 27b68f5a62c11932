// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/decoder/sandbox.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>

#include <seccomp.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include "descriptor/base/error.h"

namespace pliant::server {

namespace {

[[noreturn]] void Fail(const std::string& what) {
  throw Error(ErrorCode::kInternal, "sandbox_failed", what + ": " + std::strerror(errno));
}

// One that is stricter already stays: to raise it would take a privilege.
void Limit(int resource, rlim_t value, const char* name) {
  const auto which = static_cast<__rlimit_resource_t>(resource);
  rlimit limit{};
  if (getrlimit(which, &limit) != 0) Fail(name);
  limit.rlim_max = std::min(value, limit.rlim_max);
  limit.rlim_cur = limit.rlim_max;
  if (setrlimit(which, &limit) != 0) Fail(name);
}

// Of address space (proc(5), statm).
rlim_t UsedBytes() {
  std::ifstream file("/proc/self/statm");
  rlim_t pages = 0;
  if (!(file >> pages)) Fail("/proc/self/statm");
  return pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE));
}

class Filter {
 public:
  Filter() {
    // Kernels before 4.14, and those that do not let us ask, end the thread instead: the only one.
    context_.reset(seccomp_init(SCMP_ACT_KILL_PROCESS));
    if (!context_) context_.reset(seccomp_init(SCMP_ACT_KILL));
    error_ = context_ ? 0 : -EINVAL;
  }

  template <typename... Conditions>
  void Allow(int call, Conditions... conditions) {
    if (error_ != 0) return;
    error_ = seccomp_rule_add(context_.get(), SCMP_ACT_ALLOW, call, sizeof...(conditions),
                              conditions...);
  }

  // 0, or an error number.
  int Load() {
    if (error_ == 0) error_ = seccomp_load(context_.get());
    return -error_;
  }

 private:
  struct Release {
    void operator()(scmp_filter_ctx context) const { seccomp_release(context); }
  };
  std::unique_ptr<void, Release> context_;
  int error_ = 0;
};

// What decoding needs, how the C library ends a process that has found its memory damaged, and
// nothing that opens, connects, starts or makes anything.
int LimitCalls(int socket) {
  Filter filter;
  const auto file = static_cast<scmp_datum_t>(socket);
  filter.Allow(SCMP_SYS(read), SCMP_A0(SCMP_CMP_EQ, file));
  filter.Allow(SCMP_SYS(write), SCMP_A0(SCMP_CMP_EQ, file));
  filter.Allow(SCMP_SYS(write), SCMP_A0(SCMP_CMP_EQ, STDERR_FILENO));
  filter.Allow(SCMP_SYS(writev), SCMP_A0(SCMP_CMP_EQ, STDERR_FILENO));
  filter.Allow(SCMP_SYS(mmap), SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0),
               SCMP_A3(SCMP_CMP_MASKED_EQ, MAP_ANONYMOUS, MAP_ANONYMOUS));
  filter.Allow(SCMP_SYS(mprotect), SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  for (const int call :
       {SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(madvise), SCMP_SYS(brk), SCMP_SYS(futex),
        SCMP_SYS(sched_yield), SCMP_SYS(getrandom), SCMP_SYS(clock_gettime), SCMP_SYS(gettimeofday),
        SCMP_SYS(sysinfo), SCMP_SYS(restart_syscall), SCMP_SYS(exit), SCMP_SYS(exit_group),
        SCMP_SYS(getpid), SCMP_SYS(gettid), SCMP_SYS(rt_sigaction), SCMP_SYS(rt_sigprocmask),
        SCMP_SYS(rt_sigreturn)}) {
    filter.Allow(call);
  }
  filter.Allow(SCMP_SYS(tgkill), SCMP_A0(SCMP_CMP_EQ, static_cast<scmp_datum_t>(getpid())));
  return filter.Load();
}

}  // namespace

std::string EnterSandbox(int socket, const SandboxLimits& limits) {
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) Fail("no new privileges");
  Limit(RLIMIT_CORE, 0, "RLIMIT_CORE");
  Limit(RLIMIT_FSIZE, 0, "RLIMIT_FSIZE");
  Limit(RLIMIT_CPU, static_cast<rlim_t>(limits.cpu_s), "RLIMIT_CPU");
  if (kSanitized) return "this build has a sanitizer";
  if (prctl(PR_SET_DUMPABLE, 0, 0, 0, 0) != 0) Fail("not dumpable");
  Limit(RLIMIT_AS, UsedBytes() + static_cast<rlim_t>(limits.memory_bytes), "RLIMIT_AS");
  Limit(RLIMIT_NOFILE, static_cast<rlim_t>(socket) + 1, "RLIMIT_NOFILE");
  const int error = LimitCalls(socket);
  return error == 0 ? "" : std::string("seccomp: ") + std::strerror(error);
}

}  // namespace pliant::server
