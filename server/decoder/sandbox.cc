// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/decoder/sandbox.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <utility>

#include <sched.h>
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

// A stricter limit stays: raising it would take a privilege.
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

// Allows what decoding needs, with the thread that libde265 starts, how the C library
// ends a process that has found its memory damaged, and nothing that opens, connects, starts or
// makes anything else. Returns 0 or an error number.
int LimitCalls(int socket) {
  std::unique_ptr<void, decltype(&seccomp_release)> filter(seccomp_init(SCMP_ACT_KILL_PROCESS),
                                                           seccomp_release);
  // Kernels before 4.14, and those that do not let us ask, end the thread instead.
  if (!filter) filter.reset(seccomp_init(SCMP_ACT_KILL));
  int error = filter ? 0 : -EINVAL;
  const auto allow = [&](int call, auto... conditions) {
    if (error != 0) return;
    error =
        seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, call, sizeof...(conditions), conditions...);
  };
  const auto file = static_cast<scmp_datum_t>(socket);
  allow(SCMP_SYS(read), SCMP_A0(SCMP_CMP_EQ, file));
  allow(SCMP_SYS(write), SCMP_A0(SCMP_CMP_EQ, file));
  allow(SCMP_SYS(write), SCMP_A0(SCMP_CMP_EQ, STDERR_FILENO));
  allow(SCMP_SYS(writev), SCMP_A0(SCMP_CMP_EQ, STDERR_FILENO));
  allow(SCMP_SYS(mmap), SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0),
        SCMP_A3(SCMP_CMP_MASKED_EQ, MAP_ANONYMOUS, MAP_ANONYMOUS));
  allow(SCMP_SYS(mprotect), SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
  for (const int call :
       {SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(madvise), SCMP_SYS(brk), SCMP_SYS(futex),
        SCMP_SYS(sched_yield), SCMP_SYS(getrandom), SCMP_SYS(clock_gettime), SCMP_SYS(gettimeofday),
        SCMP_SYS(sysinfo), SCMP_SYS(restart_syscall), SCMP_SYS(exit), SCMP_SYS(exit_group),
        SCMP_SYS(getpid), SCMP_SYS(gettid), SCMP_SYS(rt_sigaction), SCMP_SYS(rt_sigprocmask),
        SCMP_SYS(rt_sigreturn)}) {
    allow(call);
  }
  constexpr scmp_datum_t kThread = CLONE_VM | CLONE_SIGHAND | CLONE_THREAD;
  allow(SCMP_SYS(clone), SCMP_A0(SCMP_CMP_MASKED_EQ, kThread, kThread));
  allow(SCMP_SYS(set_robust_list));
  allow(SCMP_SYS(rseq));
  // The C library falls back to clone: a filter cannot see the flags of clone3. dav1d starts no
  // threads when it cannot count the processors.
  for (const auto& [call, answer] :
       {std::pair(SCMP_SYS(clone3), ENOSYS), std::pair(SCMP_SYS(sched_getaffinity), EPERM)}) {
    if (error == 0) error = seccomp_rule_add(filter.get(), SCMP_ACT_ERRNO(answer), call, 0);
  }
  allow(SCMP_SYS(prctl), SCMP_A0(SCMP_CMP_EQ, PR_SET_NAME));
  allow(SCMP_SYS(tgkill), SCMP_A0(SCMP_CMP_EQ, static_cast<scmp_datum_t>(getpid())));
  if (error == 0) error = seccomp_load(filter.get());
  return -error;
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
