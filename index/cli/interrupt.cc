// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/interrupt.h"

#include <atomic>
#include <chrono>
#include <csignal>

namespace pliant::cli {
namespace {

std::atomic<int> signalled{0};
static_assert(std::atomic<int>::is_always_lock_free, "set by a signal handler");

extern "C" void OnSignal(int number) { signalled = number; }

void Install(void (*handler)(int), int flags) {
  for (const int number : {SIGINT, SIGTERM}) {
    struct sigaction action = {};
    // Who started the program may have told it to ignore one ("pliant index DIR & other").
    if (sigaction(number, nullptr, &action) != 0 || action.sa_handler == SIG_IGN) continue;
    action = {};
    action.sa_handler = handler;
    action.sa_flags = flags;
    sigemptyset(&action.sa_mask);
    sigaction(number, &action, nullptr);
  }
}

}  // namespace

Interrupt::Interrupt() {
  signalled = 0;
  Install(OnSignal, static_cast<int>(SA_RESETHAND) | SA_RESTART);
  watcher_ = std::jthread([this](const std::stop_token& end) {
    while (!end.stop_requested() && signalled == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    if (signalled != 0) source_.request_stop();
  });
}

Interrupt::~Interrupt() { Install(SIG_DFL, 0); }

int Interrupt::Signal() { return signalled; }

}  // namespace pliant::cli
