// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One decoder: this program again, as a child process that decodes images and can do nothing else
// (sandbox.h). The server checks everything that it sends.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <variant>

#include <sys/types.h>

#include "descriptor/base/error.h"
#include "descriptor/image/image.h"
#include "index/files/durable_file.h"

namespace pliant::server {

struct DecoderOptions {
  std::filesystem::path program = "/proc/self/exe";  // that calls RunDecoder
  // Memory for one image: the limit in DecodeOptions, its file twice, and some for the libraries.
  std::int64_t memory_bytes = std::int64_t{384} * 1024 * 1024;
  std::chrono::milliseconds timeout{30'000};  // for one image
  // Of processor time. One that has used more is replaced after its image; a little later the
  // system kills it, also while it has no image to decode and should do nothing.
  std::chrono::milliseconds worn_after{600'000};
};

// A decoder ended, or the server ended it because it broke a rule.
class DecoderEnded : public std::runtime_error {
 public:
  enum class Cause {
    kCrashed,    // by a signal, or by itself
    kForbidden,  // by a system call that decoding does not need
    kKilled,     // SIGKILL: by the system for lack of memory, or by a person
    kTimeout,    // ended here: it took too long
    kBroken,     // ended here: it sent something impossible
  };

  DecoderEnded(Cause why, const std::string& what) : std::runtime_error(what), cause(why) {}

  Cause cause;
};
inline constexpr std::size_t kDecoderCauses = 5;
const char* DecoderCauseName(DecoderEnded::Cause cause);  // "crashed", "forbidden", ...

// Not thread-safe: one image at a time.
class DecoderProcess {
 public:
  // Starts the program, which the system kills when the calling thread ends. Throws Error
  // kUnavailable "decoder_not_started".
  explicit DecoderProcess(const DecoderOptions& options);
  ~DecoderProcess();  // kills it
  DecoderProcess(const DecoderProcess&) = delete;
  DecoderProcess& operator=(const DecoderProcess&) = delete;

  // Once, before the first image: waits until it is ready. Returns why its system calls are not
  // limited, empty when they are. Throws Error kUnavailable "decoder_not_started".
  std::string AwaitReady();

  // While it waits for an image: throws DecoderEnded if it has ended.
  void CheckAlive();

  // Returns or throws the same as DecodeImage. Throws DecoderEnded; do not use the process after
  // that.
  std::variant<DecodedImage, Error> Decode(Bytes bytes, const DecodeOptions& options);

  pid_t id() const { return pid_; }
  bool worn() const;  // see DecoderOptions

 private:
  using Clock = std::chrono::steady_clock;

  void Wait(short event, Clock::time_point deadline);
  template <typename Call>
  void Transfer(std::size_t bytes, short event, Clock::time_point deadline, Call call);
  void Send(const void* from, std::size_t bytes, Clock::time_point deadline);
  void Receive(void* to, std::size_t bytes, Clock::time_point deadline);
  [[noreturn]] void ThrowEnded();
  void Kill();

  const DecoderOptions options_;
  pid_t pid_ = -1;  // -1 = waited for
  FileHandle socket_;
};

}  // namespace pliant::server
