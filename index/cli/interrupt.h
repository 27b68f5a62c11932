// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Turns Ctrl-C and SIGTERM into a stop request during the lifetime of this object; a second signal
// ends the program immediately.
#pragma once

#include <stop_token>
#include <thread>

namespace pliant::cli {

class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  bool requested() const { return Signal() != 0; }
  // The signal that came during the last object's lifetime, or 0.
  static int Signal();

  std::stop_token token() const { return source_.get_token(); }  // set within 50 ms

 private:
  std::stop_source source_;
  std::jthread watcher_;
};

}  // namespace pliant::cli
