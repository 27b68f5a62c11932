// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/decoder/decoder_pool.h"

#include <future>
#include <utility>
#include <variant>

#include <httplib.h>
#include <spdlog/spdlog.h>

namespace pliant::server {

namespace {

using Cause = DecoderEnded::Cause;

Error RefusalOf(const DecoderEnded& ended) {
  if (ended.cause == Cause::kTimeout) {
    return {ErrorCode::kTooLarge, "image_too_large",
            "Decoding the image takes longer than allowed. Scale it down, or save it as a "
            "non-progressive JPEG."};
  }
  return {ErrorCode::kUnprocessable, "image_corrupt",
          "The image cannot be decoded: it crashed the decoder. Save it again as JPEG or PNG."};
}

}  // namespace

// Decoders end with the thread that started them, so that is one that stays.
struct DecoderPool::Starter {
  ~Starter() { thread.shutdown(); }
  httplib::ThreadPool thread{1};
};

DecoderPool::DecoderPool(DecoderOptions options, std::function<void(DecoderEnded::Cause)> on_ended)
    : options_(std::move(options)),
      on_ended_(std::move(on_ended)),
      starter_(std::make_unique<Starter>()) {
  Decoder first = Start();
  missing_ = first->AwaitReady();
  waiting_.push_back(std::move(first));
}

DecoderPool::~DecoderPool() = default;

DecodedImage DecoderPool::Decode(Bytes bytes, const DecodeOptions& options) {
  if (static_cast<std::int64_t>(bytes.size()) > options.max_bytes) {
    return DecodeImage(bytes, options);  // refuses it without looking at it
  }
  ++busy_;
  const std::shared_ptr<void> counted(this, [this](void*) { --busy_; });
  for (bool again = false;; again = true) {
    Decoder decoder = Take();
    try {
      auto answer = decoder->Decode(bytes, options);
      Return(std::move(decoder));
      if (auto* error = std::get_if<Error>(&answer)) throw std::move(*error);
      return std::get<DecodedImage>(std::move(answer));
    } catch (const DecoderEnded& ended) {
      Report(ended, "while it decoded an image of " + std::to_string(bytes.size()) + " bytes");
      // No image gets a decoder killed: it meets other limits. Somebody else ended it.
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
      Report(ended, "while idle");
    }
  }
  Decoder started = Start();
  const std::string missing = started->AwaitReady();
  if (!missing.empty() && missing_.empty()) {  // the first one was held
    throw Error(ErrorCode::kUnavailable, "decoder_not_started",
                "a new decoder lacks limits that the first one had: " + missing);
  }
  return started;
}

DecoderPool::Decoder DecoderPool::Start() {
  const auto task = std::make_shared<std::packaged_task<Decoder()>>(
      [this] { return std::make_unique<DecoderProcess>(options_); });
  std::future<Decoder> started = task->get_future();
  starter_->thread.enqueue([task] { (*task)(); });
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

}  // namespace pliant::server
