// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A client's connection as the HTTP library sees it, with the limits the library lacks: a deadline
// for a whole request (not only for each read), and bounds on the bytes of lines, headers and body.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include <httplib.h>

#include "server/http/tls.h"

namespace pliant::server {

using Clock = std::chrono::steady_clock;

struct ConnectionLimits {
  std::chrono::milliseconds idle_timeout{5'000};      // between requests
  std::chrono::milliseconds header_timeout{10'000};   // first byte to end of headers
  std::chrono::milliseconds body_timeout{60'000};     // end of headers to end of body
  std::chrono::milliseconds write_timeout{10'000};    // for each piece of the answer
  std::chrono::milliseconds answer_timeout{120'000};  // for the whole answer
  std::size_t max_header_bytes = 32 * 1024;
  std::size_t max_body_bytes = 32 * 1024 * 1024;
};

// Used by one thread.
class Connection final : public httplib::Stream {
 public:
  enum class Fault { kNone, kClosed, kTimeout, kHeadersTooLarge, kBodyTooLarge };

  // `wake_fd` turns readable when idle connections shall end. Neither descriptor is owned.
  // `tls` may be null.
  Connection(int socket_fd, int wake_fd, const ConnectionLimits& limits,
             std::unique_ptr<TlsSession> tls = nullptr);

  // Greets the client where there is TLS, within the time for headers. False: it cannot be served.
  bool Handshake();
  bool encrypted() const { return tls_ != nullptr; }

  // Waits for the first byte of the next request. False: closed, idle for too long, or woken.
  bool AwaitRequest(std::chrono::milliseconds idle_timeout);
  void BeginHeaders();
  void BeginBody();

  Fault fault() const { return fault_; }
  std::size_t header_bytes() const { return header_bytes_; }
  std::size_t body_bytes() const { return body_bytes_; }

  // Sends what can be sent without waiting.
  void SendNow(const std::string& text);

  // Under TLS, tells the client that no more comes (close_notify: RFC 8446, 6.1; RFC 9112, 9.8).
  // For connections that end with an answer which said so, or that the client has ended. Not for
  // one that waits for a request: clients that only look whether there are bytes to read
  // (cpp-httplib 0.11) take the alert for a living connection, send the next request and fail,
  // while a bare end makes them connect again. Nothing can be cut off there: every answer was
  // complete by its length.
  void Farewell();

  // Tells the client that no more comes and swallows what it still sends, so that it can read the
  // answer before the connection ends: closing with unread bytes would reset it (RFC 9112, 9.6).
  void LingeringClose();

  bool is_readable() const override;
  bool is_writable() const override;
  ssize_t read(char* data, size_t size) override;
  ssize_t write(const char* data, size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  socket_t socket() const override { return socket_fd_; }

 private:
  bool FillFromTls();
  bool Fill();  // the buffer is empty; false sets fault_

  std::unique_ptr<TlsSession> tls_;
  int socket_fd_;
  int wake_fd_;
  ConnectionLimits limits_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  Clock::time_point deadline_;
  Clock::time_point answer_deadline_;  // set by the first write after BeginHeaders
  bool answering_ = false;
  bool in_body_ = false;
  std::size_t line_bytes_ = 0;  // so far of the line that is being read
  std::size_t header_bytes_ = 0;
  std::size_t body_bytes_ = 0;
  Fault fault_ = Fault::kNone;
};

}  // namespace pliant::server
