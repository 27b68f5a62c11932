// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A client's socket, with and without TLS, so that deadlines and limits are the same for both.
// OpenSSL's types stay inside.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include <sys/types.h>

#include "index/files/durable_file.h"

struct ssl_ctx_st;
struct ssl_st;

namespace pliant::server {

// Certificate and key, shared by all connections. Thread-safe.
class TlsContext {
 public:
  // PEM files: the certificate followed by those between it and the root, and its private key.
  // TLS 1.2 and newer. Throws Error kInvalidArgument "tls_invalid" naming the file, also when the
  // two do not belong together.
  TlsContext(const std::string& certificate_file, const std::string& key_file);

 private:
  friend class Socket;
  std::unique_ptr<ssl_ctx_st, void (*)(ssl_ctx_st*)> context_;
};

// Used by one thread at a time.
class Socket {
 public:
  static constexpr ssize_t kEnded = 0;
  static constexpr ssize_t kFailed = -1;
  static constexpr ssize_t kWait = -2;  // see awaited()

  // Owns `fd` and makes it non-blocking. `tls` can be null.
  Socket(int fd, const TlsContext* tls);

  int fd() const { return file_.get(); }
  bool encrypted() const { return encrypted_; }
  std::string PeerAddress() const;

  // > 0: done, or bytes. Else one of the constants above.
  ssize_t Handshake();  // only with TLS
  ssize_t Read(char* data, std::size_t size);
  ssize_t Write(const char* data, std::size_t size);
  ssize_t Discard();                                  // up to 16 KB, below TLS
  std::uint32_t awaited() const { return awaited_; }  // EPOLLIN or EPOLLOUT, before the next try

  // Says that nothing more comes; the client can still read what was sent. Under TLS that is
  // close_notify (RFC 8446, 6.1; RFC 9112, 9.8).
  void EndSending();
  void Shutdown();  // in both directions

 private:
  template <typename Call>
  ssize_t Plain(std::uint32_t events, Call call);
  template <typename Call>
  ssize_t Encrypted(std::uint32_t events, Call call);

  const FileHandle file_;
  const bool encrypted_;
  std::unique_ptr<ssl_st, void (*)(ssl_st*)> ssl_;
  bool failed_ = false;  // then OpenSSL must not be asked to shut down
  bool established_ = false;
  std::uint32_t awaited_;
};

}  // namespace pliant::server
