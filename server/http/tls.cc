// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/tls.h"

#include <algorithm>
#include <cerrno>
#include <climits>

#include <fcntl.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <poll.h>

#include "descriptor/base/error.h"

namespace pliant::server {

namespace {

[[noreturn]] void ThrowTls(const std::string& what) {
  char reason[256] = "no reason given";
  if (const unsigned long code = ERR_get_error()) ERR_error_string_n(code, reason, sizeof(reason));
  ERR_clear_error();
  throw Error(ErrorCode::kInvalidArgument, "tls_invalid", what + ": " + reason);
}

}  // namespace

class TlsContext::Impl {
 public:
  Impl() : context(SSL_CTX_new(TLS_server_method())) {
    if (context == nullptr) ThrowTls("TLS cannot be set up");
  }
  ~Impl() { SSL_CTX_free(context); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  SSL_CTX* context;
};

TlsContext::TlsContext(const std::string& certificate_file, const std::string& key_file)
    : impl_(std::make_unique<Impl>()) {
  SSL_CTX* context = impl_->context;
  SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
  // Without key exchange by the certificate's own key, which keeps no secret once that is lost.
  if (SSL_CTX_set_cipher_list(context, "HIGH:!kRSA:!aNULL:!eNULL:!PSK:!SRP") != 1) {
    ThrowTls("The ciphers cannot be chosen");
  }
  SSL_CTX_set_options(context, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  SSL_CTX_set_mode(context, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER |
                                SSL_MODE_RELEASE_BUFFERS);
  if (SSL_CTX_use_certificate_chain_file(context, certificate_file.c_str()) != 1) {
    ThrowTls("--tls-cert " + certificate_file);
  }
  if (SSL_CTX_use_PrivateKey_file(context, key_file.c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_check_private_key(context) != 1) {
    ThrowTls("--tls-key " + key_file);
  }
}

TlsContext::~TlsContext() = default;

class TlsSession::Impl {
 public:
  Impl(SSL_CTX* context, int fd) : socket_fd(fd), ssl(SSL_new(context)) {
    if (ssl != nullptr) SSL_set_fd(ssl, fd);
  }
  ~Impl() { SSL_free(ssl); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // Runs `step` until it does something, fails, or the deadline passes.
  template <typename Step>
  ssize_t Drive(Step step, Clock::time_point deadline) {
    if (ssl == nullptr || failed) return -1;
    while (true) {
      ERR_clear_error();
      const int done = step();
      if (done > 0) return done;
      const int error = SSL_get_error(ssl, done);
      if (error == SSL_ERROR_ZERO_RETURN) return 0;
      if (error != SSL_ERROR_WANT_READ && error != SSL_ERROR_WANT_WRITE) {
        failed = true;
        ERR_clear_error();
        return -1;
      }
      wants_output = error == SSL_ERROR_WANT_WRITE;
      if (!Await(wants_output ? POLLOUT : POLLIN, deadline)) return -2;
    }
  }

  bool Await(short events, Clock::time_point deadline) const {
    while (true) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
      if (left <= 0) return false;
      pollfd fd = {socket_fd, events, 0};
      const int ready = poll(&fd, 1, static_cast<int>(std::min<long long>(left, INT_MAX)));
      if (ready > 0) return true;
      if (ready == 0 || errno != EINTR) return false;
    }
  }

  const int socket_fd;
  SSL* ssl;
  bool failed = false;  // after which OpenSSL must not be asked to shut down
  bool greeted = false;
  bool wants_output = false;
};

TlsSession::TlsSession(const TlsContext& context, int socket_fd)
    : impl_(std::make_unique<Impl>(context.impl_->context, socket_fd)) {
  fcntl(socket_fd, F_SETFL, fcntl(socket_fd, F_GETFL) | O_NONBLOCK);
}

TlsSession::~TlsSession() = default;

ssize_t TlsSession::Handshake(Clock::time_point deadline) {
  const ssize_t done = impl_->Drive([&] { return SSL_accept(impl_->ssl); }, deadline);
  impl_->greeted = done > 0;
  return done;
}

bool TlsSession::wants_output() const { return impl_->wants_output; }

ssize_t TlsSession::Read(char* data, std::size_t size, Clock::time_point deadline) {
  const int most = static_cast<int>(std::min<std::size_t>(size, INT_MAX));
  return impl_->Drive([&] { return SSL_read(impl_->ssl, data, most); }, deadline);
}

ssize_t TlsSession::Write(const char* data, std::size_t size, Clock::time_point deadline) {
  const int most = static_cast<int>(std::min<std::size_t>(size, INT_MAX));
  return impl_->Drive([&] { return SSL_write(impl_->ssl, data, most); }, deadline);
}

void TlsSession::Close() {
  if (impl_->greeted && !impl_->failed) SSL_shutdown(impl_->ssl);
  ERR_clear_error();
}

}  // namespace pliant::server
