// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A real pliant-server with a real database: started on a free port, talked to over loopback,
// stopped by signals.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <httplib.h>
#include <nlohmann/json.hpp>

#include "tests/integration/program.h"
namespace pliant::testing {

using Json = nlohmann::json;

std::filesystem::path ServerPath();

// The file's name; with PLIANT_TEST_DATABASE, a postgresql:// URL, the URL of the schema of that
// database that stands for the file: the first call for a file creates its schema.
std::string DatabaseOf(const std::filesystem::path& file);

class ServerProcess {
 public:
  // Waits until the server says that it listens; throws when it does not. Images are described
  // by RootSIFT, which is fast; `flags` come after and may say otherwise. The database is what
  // DatabaseOf() gives.
  explicit ServerProcess(const std::filesystem::path& database,
                         const std::vector<std::string>& flags = {});

  int port() const { return port_; }
  int id() const { return program_.id(); }
  httplib::Client Client() const;

  void Signal(int number) const { program_.Signal(number); }
  // From now on no file may grow beyond that; RLIM_INFINITY = as it likes. As good as a full disk.
  void LimitFiles(std::uint64_t bytes) const;
  // The exit status, or 128 + the signal that ended it.
  int Wait() { return program_.Wait().status; }
  int Stop();  // SIGTERM and Wait

  std::string Log() const { return program_.Err(); }

  // Sends the bytes and returns what comes back until the server closes or nothing came for
  // `patience`. With `drip`, one more byte follows every 100 ms until then.
  std::string Talk(const std::string& bytes,
                   std::chrono::milliseconds patience = std::chrono::milliseconds(3'000),
                   bool drip = false) const;

  // A connection on which the bytes were sent, to be closed by the caller; -1 when there is none.
  int Open(const std::string& bytes) const;

 private:
  Program program_;
  int port_ = 0;
};

// The number behind "name " in the server's metrics; `name` with its labels. Throws
// std::runtime_error when there is no such metric: no number may stand for one that is missing.
double Metric(httplib::Client& client, const std::string& name);

// Encoded PNG of an imaginary object: blobs placed by the seed. `view` turns, scales and shifts
// it, so that two views of one object are different bytes with the same texture.
std::string TestImage(std::uint64_t object_seed, int view = 0, int width = 320, int height = 240);

// Sends a request as a table says it: method, path, body, and type unless it is empty.
template <typename Row>
httplib::Result Send(httplib::Client& client, const Row& row) {
  httplib::Request request;
  request.method = row.method;
  request.path = row.path;
  request.body = row.body;
  if (!row.type.empty()) request.set_header("Content-Type", row.type);
  return client.send(request);
}

}  // namespace pliant::testing
