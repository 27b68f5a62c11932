// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Decodes images in processes of their own. As many decoders are started as images are decoded
// at once; then they wait for the next. One that ends, or has to be ended, is replaced.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/decoder/decoder_process.h"

namespace pliant::server {

// Thread-safe.
class DecoderPool {
 public:
  // Starts the first decoder and waits until it is ready: what cannot work is known at once. Throws
  // Error kUnavailable "decoder_not_started". `on_ended` hears of each decoder that ended, or had
  // to be ended, before the pool does, from any thread; it must not throw.
  explicit DecoderPool(DecoderOptions options,
                       std::function<void(DecoderEnded::Cause)> on_ended = {});
  ~DecoderPool();  // ends the decoders; no call may be running
  DecoderPool(const DecoderPool&) = delete;
  DecoderPool& operator=(const DecoderPool&) = delete;

  // As DecodeImage. An image during which the decoder ends is refused: kTooLarge
  // "image_too_large" when it took too long, kUnprocessable "image_corrupt" otherwise. Throws
  // kUnavailable "decoder_not_started" as well.
  DecodedImage Decode(Bytes bytes, const DecodeOptions& options);

  // Why the decoders' system calls are not limited; empty = they are.
  const std::string& missing() const { return missing_; }

  std::size_t size() const;               // decoders that run
  std::vector<pid_t> WaitingIds() const;  // of those that have nothing to do

 private:
  using Decoder = std::unique_ptr<DecoderProcess>;

  Decoder Take();
  Decoder Start();
  void Return(Decoder decoder);
  void Report(const DecoderEnded& ended, const std::string& when) const;
  void StartForOthers();

  const DecoderOptions options_;
  const std::function<void(DecoderEnded::Cause)> on_ended_;
  std::string missing_;

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable wanted_changed_;
  std::deque<std::packaged_task<Decoder()>> wanted_;
  std::vector<Decoder> waiting_;  // the last is the one used last
  std::size_t busy_ = 0;
  bool stopping_ = false;
  // Decoders end with the thread that started them, so that is none that comes and goes.
  std::thread starter_;
};

}  // namespace pliant::server
