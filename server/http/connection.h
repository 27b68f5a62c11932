// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A client's connection. Requests are received as a whole before the HTTP library reads them, and
// what the client does not take at once of an answer is sent later: a thread that serves a request
// never waits for a client. Receiving and sending are steps that do not wait; Reception takes them.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <string>
#include <string_view>

#include <httplib.h>

#include "server/http/body_file.h"
#include "server/http/body_sink.h"
#include "server/http/request_head.h"
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

// Bytes of all connections that are in memory at once: bodies that were received, answers that
// were not taken. Thread-safe.
struct MemoryBudget {
  std::size_t most = 0;
  std::atomic<std::size_t> used{0};

  bool Take(std::size_t bytes);  // false: that would be too many, none are taken
  void Give(std::size_t bytes) { used -= bytes; }
};

// Used by one thread at a time.
class Connection final : public httplib::Stream {
 public:
  enum class Fault {
    kNone,
    kTimeout,
    kHeadersTooLarge,
    kBadHead,  // head().fault says why
    kBodyTooLarge,
    kBadBody,
    kBusy,  // the budget is used up
    kSink,  // what the body goes into has refused it: see RethrowSinkError()
  };
  // What a step has come to: kDone, or what must happen before it is taken again. kOver: the
  // connection has ended.
  enum class Step { kDone, kWantsInput, kWantsOutput, kOver };

  // Owns the socket and makes it non-blocking. `limits` and `budget` must outlive the connection;
  // `tls` may be null.
  Connection(int socket_fd, const ConnectionLimits& limits, MemoryBudget* budget,
             std::unique_ptr<TlsSession> tls);
  ~Connection() override;

  Step Greet();        // TLS, where there is one
  Step ReceiveHead();  // kDone: it is there, or fault() says why it is refused
  Step ReceiveBody();  // likewise, for the body that head() announces
  Step Send();         // kDone: the client has taken all
  Step Swallow();      // kOver: the client has ended, or sends without end

  // The body goes there from now on, whatever its length, and is no part of what the library reads.
  // To be called after ReceiveHead(), before ReceiveBody(), which then comes back after each
  // megabyte: others have their turn. The sink says when a body of chunks has too much content.
  void ReceiveInto(std::shared_ptr<BodySink> sink);
  bool receives_into_sink() const { return sink_ != nullptr; }
  bool is_chunked() const { return head_.framing == BodyFraming::kChunked; }
  // What is still to come of a body that says its length.
  std::uint64_t sink_left() const {
    return sink_ && !is_chunked() ? head_.length - body_bytes_ : 0;
  }
  [[noreturn]] void RethrowSinkError() const { std::rethrow_exception(sink_error_); }

  void SetFault(Fault fault) { fault_ = fault; }
  Fault fault() const { return fault_; }
  const RequestHead& head() const { return head_; }
  bool has_bytes() const { return begin_ < received_.size(); }  // of a request
  bool body_received() const { return body_received_; }
  std::size_t body_bytes() const { return body_bytes_; }
  const std::string& address() const { return address_; }
  bool encrypted() const { return tls_ != nullptr; }

  // The library may read the request (again) from its beginning.
  void Rewind();
  // What the library writes from now on until Rewind() is dropped.
  void DropOutput() { drop_output_ = true; }
  // The request was served: forgets it. What came after it stays.
  void ForgetRequest();

  // What the library writes next, as many bytes as the file has, is the file: Send() sends it piece
  // by piece. To be called when the answer's head is written.
  void SendFile(std::shared_ptr<const BodyFile> file);
  // Bytes of a file that are still to be sent.
  std::uint64_t file_left() const { return file_ ? file_->size() - file_sent_ : 0; }

  // Says that no more comes. Under TLS that is close_notify (RFC 8446, 6.1; RFC 9112, 9.8), for
  // connections that end with an answer which said so, or that the client has ended. Not for one
  // that waits for a request: clients that only look whether there are bytes to read (cpp-httplib
  // 0.11) take the alert for a living connection, send the next request and fail, while a bare end
  // makes them connect again. Nothing can be cut off there: every answer was complete by its
  // length.
  void Farewell();
  // Ends sending; the client can still read what was sent. Swallow() then reads what it still
  // sends: closing with unread bytes would reset the connection (RFC 9112, 9.6).
  void EndSending();

  bool is_readable() const override { return has_bytes(); }
  bool is_writable() const override { return true; }
  ssize_t read(char* data, size_t size) override;
  // Sends what can be sent without waiting and keeps the rest for Send(). Fails when the budget is
  // used up, but for short answers.
  ssize_t write(const char* data, size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  socket_t socket() const override { return socket_fd_; }

 private:
  Step Receive();                            // what is there, appended to received_
  ssize_t SendSome(std::string_view bytes);  // > 0 sent, 0 nothing now, -1 failed
  void Hold(std::size_t bytes);
  Step JudgeBody();
  Step PassOn();  // JudgeBody() of a body that goes into a sink
  bool TakesAnnounced(std::size_t size);
  bool Refill();  // unsent_ with the next piece of the file
  Step SendFileOn();

  std::unique_ptr<TlsSession> tls_;
  int socket_fd_;
  const ConnectionLimits& limits_;
  MemoryBudget* budget_;
  std::size_t held_ = 0;  // of the budget
  std::string address_;
  int port_ = 0;

  std::string received_;
  std::size_t begin_ = 0;     // of the request
  std::size_t read_ = 0;      // how far the library is
  std::size_t searched_ = 0;  // for the end of the head
  std::size_t head_end_ = 0;
  std::size_t end_ = 0;  // of the request, as far as it is known
  RequestHead head_;
  ChunkedBody chunks_{0};
  bool body_received_ = false;
  std::size_t body_bytes_ = 0;     // into a sink: the content alone
  std::size_t framing_bytes_ = 0;  // of the chunks of such a body
  Fault fault_ = Fault::kNone;
  std::shared_ptr<BodySink> sink_;
  std::exception_ptr sink_error_;

  std::string unsent_;
  std::size_t sent_ = 0;                  // of unsent_
  std::shared_ptr<const BodyFile> file_;  // sent after unsent_
  std::uint64_t file_sent_ = 0;           // or in unsent_
  std::uint64_t announced_ = 0;           // bytes of it that the library has not "written" yet
  bool drop_output_ = false;
  bool over_ = false;
  std::size_t swallowed_ = 0;
};

}  // namespace pliant::server
