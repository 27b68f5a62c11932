// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/http/socket.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <climits>
#include <cstring>

#include <fcntl.h>
#include <netdb.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include "descriptor/base/error.h"

namespace pliant::server {

namespace {

[[noreturn]] void ThrowTls(const std::string& what) {
  const unsigned long code = ERR_get_error();
  const char* const reason =
      ERR_SYSTEM_ERROR(code) ? std::strerror(ERR_GET_REASON(code)) : ERR_reason_error_string(code);
  ERR_clear_error();
  throw Error(ErrorCode::kInvalidArgument, "tls_invalid",
              what + (reason == nullptr ? "" : std::string(": ") + reason));
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
    ThrowTls("The TLS ciphers cannot be set");
  }
  SSL_CTX_set_options(context, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION);
  SSL_CTX_set_mode(context, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER |
                                SSL_MODE_RELEASE_BUFFERS);
  if (SSL_CTX_use_certificate_chain_file(context, certificate_file.c_str()) != 1) {
    ThrowTls("--tls-cert " + certificate_file + " holds no certificate (PEM) that can be used");
  }
  if (SSL_CTX_use_PrivateKey_file(context, key_file.c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_check_private_key(context) != 1) {
    ThrowTls("--tls-key " + key_file + " holds no private key (PEM) of the certificate");
  }
}

Socket::Socket(int fd, const TlsContext* tls)
    : file_(fd),
      encrypted_(tls != nullptr),
      ssl_(encrypted_ ? SSL_new(tls->context_.get()) : nullptr, SSL_free),
      awaited_(EPOLLIN) {
  fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
  if (encrypted_) failed_ = ssl_ == nullptr || SSL_set_fd(ssl_.get(), fd) != 1;
}

std::string Socket::PeerAddress() const {
  sockaddr_storage address{};
  socklen_t length = sizeof(address);
  std::array<char, NI_MAXHOST> host{};
  auto* peer = reinterpret_cast<sockaddr*>(&address);
  const bool known =
      getpeername(fd(), peer, &length) == 0 &&
      getnameinfo(peer, length, host.data(), host.size(), nullptr, 0, NI_NUMERICHOST) == 0;
  return known ? host.data() : "";
}

template <typename Call>
ssize_t Socket::Plain(std::uint32_t events, Call call) {
  awaited_ = events;
  ssize_t result = 0;
  do {
    result = call();
  } while (result < 0 && errno == EINTR);
  const bool waits = result < 0 && (errno == EAGAIN || errno == EWOULDBLOCK);
  return waits ? kWait : result;
}

template <typename Call>
ssize_t Socket::Encrypted(std::uint32_t events, Call call) {
  awaited_ = events;
  if (failed_) return kFailed;
  ERR_clear_error();
  const int done = call();
  if (done > 0) return done;
  const int error = SSL_get_error(ssl_.get(), done);
  if (error == SSL_ERROR_ZERO_RETURN) return kEnded;
  failed_ = error != SSL_ERROR_WANT_WRITE && error != SSL_ERROR_WANT_READ;
  awaited_ = error == SSL_ERROR_WANT_WRITE ? EPOLLOUT : EPOLLIN;
  return failed_ ? kFailed : kWait;
}

ssize_t Socket::Handshake() {
  const ssize_t done = Encrypted(EPOLLIN, [&] { return SSL_accept(ssl_.get()); });
  established_ = done > 0;
  return done;
}

ssize_t Socket::Read(char* data, std::size_t size) {
  if (!encrypted_) return Plain(EPOLLIN, [&] { return recv(fd(), data, size, 0); });
  return Encrypted(EPOLLIN, [&] { return SSL_read(ssl_.get(), data, AsInt(size)); });
}

ssize_t Socket::Write(const char* data, std::size_t size) {
  if (!encrypted_) return Plain(EPOLLOUT, [&] { return send(fd(), data, size, MSG_NOSIGNAL); });
  return Encrypted(EPOLLOUT, [&] { return SSL_write(ssl_.get(), data, AsInt(size)); });
}

ssize_t Socket::Discard() {
  std::array<char, 16 * 1024> nothing;
  return Plain(EPOLLIN, [&] { return recv(fd(), nothing.data(), nothing.size(), 0); });
}

void Socket::EndSending() {
  if (established_ && !failed_) SSL_shutdown(ssl_.get());
  ERR_clear_error();
  shutdown(fd(), SHUT_WR);
}

void Socket::Shutdown() { shutdown(fd(), SHUT_RDWR); }

}  // namespace pliant::server
