// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Ctrl-C and SIGTERM as a request to stop, for as long as this object lives; a second one ends the
// program at once.
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

  bool requested() const;
  std::stop_token token() const { return source_.get_token(); }  // follows within 50 ms

 private:
  std::stop_source source_;
  std::jthread watcher_;
};

}  // namespace pliant::cli
