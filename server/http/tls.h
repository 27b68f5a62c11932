// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// TLS below Connection, so that deadlines and limits are the same with and without. OpenSSL's types
// stay inside.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <string>

#include <sys/types.h>

namespace pliant::server {

// Certificate and key, shared by all connections. Thread-safe.
class TlsContext {
 public:
  // PEM files: the certificate with those between it and the root after it, and its private key.
  // Throws Error kInvalidArgument "tls_invalid" naming the file, also when the two do not belong
  // together. TLS 1.2 and newer.
  TlsContext(const std::string& certificate_file, const std::string& key_file);
  ~TlsContext();
  TlsContext(const TlsContext&) = delete;
  TlsContext& operator=(const TlsContext&) = delete;

 private:
  friend class TlsSession;
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// One connection's encryption. Used by one thread. No call outlasts its deadline.
class TlsSession {
 public:
  using Clock = std::chrono::steady_clock;

  // The socket is not owned; it is made non-blocking.
  TlsSession(const TlsContext& context, int socket_fd);
  ~TlsSession();
  TlsSession(const TlsSession&) = delete;
  TlsSession& operator=(const TlsSession&) = delete;

  // > 0 done, or bytes; 0 the other side has ended; -1 failed; -2 the deadline passed. With a
  // deadline that has passed already, does what can be done without waiting.
  ssize_t Handshake(Clock::time_point deadline);
  ssize_t Read(char* data, std::size_t size, Clock::time_point deadline);
  ssize_t Write(const char* data, std::size_t size, Clock::time_point deadline);
  bool wants_output() const;  // after -2: it waits until the socket can be written to, not read
  void Close();               // says that nothing more comes; does not wait

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace pliant::server
