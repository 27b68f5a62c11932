// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// TLS below Connection, so that deadlines and limits are the same with and without. OpenSSL's types
// stay inside.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include <sys/types.h>

struct ssl_ctx_st;
struct ssl_st;

namespace pliant::server {

// Certificate and key, shared by all connections. Thread-safe.
class TlsContext {
 public:
  // PEM files: the certificate with those between it and the root after it, and its private key.
  // Throws Error kInvalidArgument "tls_invalid" naming the file, also when the two do not belong
  // together. TLS 1.2 and newer.
  TlsContext(const std::string& certificate_file, const std::string& key_file);

 private:
  friend class TlsSession;
  std::unique_ptr<ssl_ctx_st, void (*)(ssl_ctx_st*)> context_;
};

// One connection's encryption. Used by one thread at a time.
class TlsSession {
 public:
  static constexpr ssize_t kEnded = 0;
  static constexpr ssize_t kFailed = -1;
  static constexpr ssize_t kWait = -2;  // for the socket: see wants_output()

  // The socket is not owned, and must not block.
  TlsSession(const TlsContext& context, int socket_fd);

  // > 0: done, or bytes. Else one of those above.
  ssize_t Handshake();
  ssize_t Read(char* data, std::size_t size);
  ssize_t Write(const char* data, std::size_t size);
  bool wants_output() const { return wants_output_; }  // after kWait
  void Close();                                        // says that nothing more comes

 private:
  ssize_t ResultOf(int done);

  std::unique_ptr<ssl_st, void (*)(ssl_st*)> ssl_;
  bool failed_ = false;  // after which OpenSSL must not be asked to shut down
  bool established_ = false;
  bool wants_output_ = false;
};

}  // namespace pliant::server
