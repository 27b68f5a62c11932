// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/decoder/decoder_pool.h"

#include <utility>
#include <variant>

#include <spdlog/spdlog.h>

namespace pliant::server {

namespace {

using Cause = DecoderEnded::Cause;

Error RefusalOf(const DecoderEnded& ended) {
  if (ended.cause == Cause::kTimeout) {
    return {ErrorCode::kTooLarge, "image_too_large",
            "Decoding the image takes longer than allowed. Scale it down, or save it as JPEG that "
            "is not progressive."};
  }
  return {ErrorCode::kUnprocessable, "image_corrupt",
          "The image cannot be decoded: the decoder did not survive it. Save it again as JPEG or "
          "PNG."};
}

}  // namespace

DecoderPool::DecoderPool(DecoderOptions options, std::function<void(DecoderEnded::Cause)> on_ended)
    : options_(std::move(options)),
      on_ended_(std::move(on_ended)),
      starter_([this] { StartForOthers(); }) {
  try {
    Decoder first = Start();
    missing_ = first->AwaitReady();
    waiting_.push_back(std::move(first));
  } catch (...) {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    wanted_changed_.notify_all();
    starter_.join();
    throw;
  }
}

DecoderPool::~DecoderPool() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    waiting_.clear();
  }
  wanted_changed_.notify_all();
  starter_.join();
}

DecodedImage DecoderPool::Decode(Bytes bytes, const DecodeOptions& options) {
  if (static_cast<std::int64_t>(bytes.size()) > options.max_bytes) {
    return DecodeImage(bytes, options);  // refuses it without looking at it
  }
  struct Busy {  // counts this image
    explicit Busy(DecoderPool& in) : pool(in) { Add(1); }
    ~Busy() { Add(-1); }
    Busy(const Busy&) = delete;
    Busy& operator=(const Busy&) = delete;
    void Add(int n) {
      const std::lock_guard lock(pool.mutex_);
      pool.busy_ += static_cast<std::size_t>(n);
    }
    DecoderPool& pool;
  };
  const Busy busy(*this);
  for (bool again = false;; again = true) {
    Decoder decoder = Take();
    try {
      auto answer = decoder->Decode(bytes, options);
      Return(std::move(decoder));
      if (auto* error = std::get_if<Error>(&answer)) throw std::move(*error);
      return std::get<DecodedImage>(std::move(answer));
    } catch (const DecoderEnded& ended) {
      Report(ended, "while it decoded an image of " + std::to_string(bytes.size()) + " bytes");
      // No image has a decoder killed: its limits are others. Somebody else wanted its end.
      if (ended.cause != Cause::kKilled || again) throw RefusalOf(ended);
    }
  }
}

std::size_t DecoderPool::size() const {
  const std::lock_guard lock(mutex_);
  return waiting_.size() + busy_;
}

std::vector<pid_t> DecoderPool::WaitingIds() const {
  const std::lock_guard lock(mutex_);
  std::vector<pid_t> ids;
  for (const Decoder& decoder : waiting_) ids.push_back(decoder->id());
  return ids;
}

DecoderPool::Decoder DecoderPool::Take() {
  for (;;) {
    Decoder decoder;
    {
      const std::lock_guard lock(mutex_);
      if (waiting_.empty()) break;
      decoder = std::move(waiting_.back());
      waiting_.pop_back();
    }
    try {
      decoder->CheckAlive();
      return decoder;
    } catch (const DecoderEnded& ended) {
      Report(ended, "while it waited");
    }
  }
  Decoder started = Start();
  const std::string missing = started->AwaitReady();
  if (!missing.empty() && missing_.empty()) {  // the first one was held
    throw Error(ErrorCode::kUnavailable, "decoder_not_started",
                "a decoder could not be limited as the first one was: " + missing);
  }
  return started;
}

DecoderPool::Decoder DecoderPool::Start() {
  std::packaged_task<Decoder()> task([this] { return std::make_unique<DecoderProcess>(options_); });
  std::future<Decoder> started = task.get_future();
  {
    const std::lock_guard lock(mutex_);
    wanted_.push_back(std::move(task));
  }
  wanted_changed_.notify_one();
  return started.get();
}

void DecoderPool::Return(Decoder decoder) {
  if (decoder->worn()) return;
  const std::lock_guard lock(mutex_);
  waiting_.push_back(std::move(decoder));
}

void DecoderPool::Report(const DecoderEnded& ended, const std::string& when) const {
  spdlog::warn("a decoder ended {}: {}", when, ended.what());
  if (on_ended_) on_ended_(ended.cause);
}

void DecoderPool::StartForOthers() {
  std::unique_lock lock(mutex_);
  for (;;) {
    wanted_changed_.wait(lock, [this] { return stopping_ || !wanted_.empty(); });
    if (wanted_.empty()) return;
    std::packaged_task<Decoder()> task = std::move(wanted_.front());
    wanted_.pop_front();
    lock.unlock();
    task();
    lock.lock();
  }
}

}  // namespace pliant::server
