// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/tls.h"

#include <algorithm>
#include <climits>

#include <openssl/err.h>
#include <openssl/ssl.h>

#include "descriptor/base/error.h"

namespace pliant::server {

namespace {

[[noreturn]] void ThrowTls(const std::string& what) {
  char reason[256] = "no reason given";
  if (const unsigned long code = ERR_get_error()) ERR_error_string_n(code, reason, sizeof(reason));
  ERR_clear_error();
  throw Error(ErrorCode::kInvalidArgument, "tls_invalid", what + ": " + reason);
}

int AsInt(std::size_t size) { return static_cast<int>(std::min<std::size_t>(size, INT_MAX)); }

}  // namespace

TlsContext::TlsContext(const std::string& certificate_file, const std::string& key_file)
    : context_(SSL_CTX_new(TLS_server_method()), SSL_CTX_free) {
  SSL_CTX* context = context_.get();
  if (context == nullptr) ThrowTls("TLS cannot be set up");
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

TlsSession::TlsSession(const TlsContext& context, int socket_fd)
    : ssl_(SSL_new(context.context_.get()), SSL_free) {
  failed_ = ssl_ == nullptr || SSL_set_fd(ssl_.get(), socket_fd) != 1;
}

ssize_t TlsSession::ResultOf(int done) {
  if (done > 0) return done;
  const int error = SSL_get_error(ssl_.get(), done);
  if (error == SSL_ERROR_ZERO_RETURN) return kEnded;
  wants_output_ = error == SSL_ERROR_WANT_WRITE;
  if (wants_output_ || error == SSL_ERROR_WANT_READ) return kWait;
  failed_ = true;
  return kFailed;
}

ssize_t TlsSession::Handshake() {
  if (failed_) return kFailed;
  ERR_clear_error();
  const ssize_t done = ResultOf(SSL_accept(ssl_.get()));
  established_ = done > 0;
  return done;
}

ssize_t TlsSession::Read(char* data, std::size_t size) {
  if (failed_) return kFailed;
  ERR_clear_error();
  return ResultOf(SSL_read(ssl_.get(), data, AsInt(size)));
}

ssize_t TlsSession::Write(const char* data, std::size_t size) {
  if (failed_) return kFailed;
  ERR_clear_error();
  return ResultOf(SSL_write(ssl_.get(), data, AsInt(size)));
}

void TlsSession::Close() {
  if (established_ && !failed_) SSL_shutdown(ssl_.get());
  ERR_clear_error();
}

}  // namespace pliant::server
