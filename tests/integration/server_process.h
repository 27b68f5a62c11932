// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A real pliant-server with a real database, for tests: started on a free port, talked to over
// loopback, stopped by signals.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <httplib.h>
#include <nlohmann/json.hpp>
#include <sys/types.h>

namespace pliant {

using Json = nlohmann::json;

// A folder that is removed at the end.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

struct ExitStatus {
  int code = -1;  // -1: ended by a signal
  int signal = 0;
};

// Runs to its end and returns how; both outputs go to `output`.
ExitStatus RunProgram(const std::vector<std::string>& command, std::string* output);

class ServerProcess {
 public:
  // Waits until the server says that it listens; throws when it does not. Pictures are described
  // by RootSIFT, which is fast; `flags` come after and may say otherwise.
  explicit ServerProcess(const std::filesystem::path& database,
                         const std::vector<std::string>& flags = {});
  ~ServerProcess();  // kill -9 when it still runs
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;

  int port() const { return port_; }
  httplib::Client Client() const;

  void Signal(int number) const;
  ExitStatus Wait();
  ExitStatus Stop();  // SIGTERM and Wait

  std::string Log() const;

  // Sends the bytes, half-closes nothing, and returns what comes back until the server closes or
  // nothing came for `patience`.
  std::string Talk(const std::string& bytes,
                   std::chrono::milliseconds patience = std::chrono::milliseconds(3'000)) const;

 private:
  void AwaitListening(int stdout_fd);

  std::filesystem::path log_;
  pid_t pid_ = -1;
  int port_ = 0;
};

// Encoded PNG of an imaginary object: blobs placed by the seed. `view` turns, scales and shifts
// it, so that two views of one object are different bytes with the same texture.
std::string TestPicture(std::uint64_t object_seed, int view = 0, int width = 320, int height = 240);

}  // namespace pliant
