// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Decodes images in sandboxed child processes. The pool starts as many decoders as images are
// decoded at once; then they wait for the next. It replaces a decoder that ends or breaks a rule.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/decoder/decoder_process.h"

namespace pliant::server {

// Thread-safe.
class DecoderPool {
 public:
  // Starts the first decoder and waits until it is ready, so that failures show at once. Throws
  // Error kUnavailable "decoder_not_started". `on_ended` is called, from any thread, for each
  // decoder that ended or was ended before the pool ends; it must not throw.
  explicit DecoderPool(DecoderOptions options,
                       std::function<void(DecoderEnded::Cause)> on_ended = {});
  ~DecoderPool();  // ends the decoders; no call must be running
  DecoderPool(const DecoderPool&) = delete;
  DecoderPool& operator=(const DecoderPool&) = delete;

  // As DecodeImage. Refuses an image during which the decoder ends: kTooLarge "image_too_large"
  // when it took too long, kUnprocessable "image_corrupt" otherwise. Throws kUnavailable
  // "decoder_not_started" as well.
  DecodedImage Decode(Bytes bytes, const DecodeOptions& options);

  // Why the decoders' system calls are not limited; empty = they are.
  const std::string& missing() const { return missing_; }

  std::size_t size() const;               // decoders that run
  std::vector<pid_t> WaitingIds() const;  // of idle decoders

 private:
  using Decoder = std::unique_ptr<DecoderProcess>;
  struct Starter;

  Decoder Take();
  Decoder Start();
  void Return(Decoder decoder);
  void Report(const DecoderEnded& ended, const std::string& when) const;

  const DecoderOptions options_;
  const std::function<void(DecoderEnded::Cause)> on_ended_;
  std::string missing_;

  const std::unique_ptr<Starter> starter_;
  std::atomic<std::size_t> busy_{0};

  mutable std::mutex mutex_;      // guards waiting_
  std::vector<Decoder> waiting_;  // the last is the one used last
};

}  // namespace pliant::server
