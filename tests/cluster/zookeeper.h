// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A ZooKeeper of Debian's package as a process, and a wire to it that can be cut.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "index/store/clickhouse/keeper.h"
#include "tests/integration/program.h"

namespace pliant::testing {

// Empty, or which package is missing.
std::string MissingForZooKeeper();

class ZooKeeper {
 public:
  ZooKeeper();  // starts it on a free port; its data go with the object

  int port() const { return port_; }
  void Start();  // goes on with the data; waits until it answers
  void Kill() { program_.reset(); }
  void Freeze() { program_->Signal(SIGSTOP); }
  void Thaw() { program_->Signal(SIGCONT); }
  std::string Ask(const std::string& word) const;  // one of its "four letter words"

 private:
  TemporaryFolder folder_;
  int port_ = 0;
  std::unique_ptr<Program> program_;
};

// Passes bytes on between a port of its own and another one, until told otherwise.
class Wire {
 public:
  // `lets_pass(to_server, bytes)`: false cuts the connection in place of passing these bytes on.
  Wire(int to_port, std::function<bool(bool to_server, const std::string& bytes)> lets_pass);
  ~Wire();
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  int port() const { return port_; }

 private:
  void Accept();
  void Serve(int client);

  const int to_port_;
  const std::function<bool(bool, const std::string&)> lets_pass_;
  int port_ = 0;
  int listener_ = -1;  // opened with the port
  std::atomic<bool> ending_{false};
  std::vector<std::thread> connections_;  // the accepting thread's until it has ended
  std::thread accepting_;
};

// Listens on a port and says nothing; the system takes the connections.
class SilentPort {
 public:
  SilentPort();
  ~SilentPort();
  SilentPort(const SilentPort&) = delete;
  SilentPort& operator=(const SilentPort&) = delete;

  int port() const { return port_; }

 private:
  int port_ = 0;
  int listener_ = -1;
};

clickhouse::KeeperOptions KeeperAt(int port);

}  // namespace pliant::testing
