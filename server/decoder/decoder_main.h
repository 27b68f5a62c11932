// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The program as a decoder, which DecoderProcess starts, and the messages between the two on a
// stream socket. Both are the same program, so plain structures will do. The server checks
// everything that a decoder sends: an image can have taken it over.
#pragma once

#include <cstdint>
#include <type_traits>

#include "descriptor/image/image.h"

namespace pliant::server {

// The program's first argument as a decoder. The process id of the server and the limits follow:
// bytes of memory, seconds of processor time.
inline constexpr const char* kDecoderArgument = "--decode-for";
inline constexpr int kDecoderSocket = 3;  // the only open file beside 0, 1 and 2

// From the decoder, once.
struct DecoderGreeting {
  std::uint32_t ready = 0;  // 1, or it ends and `text` says why
  char text[252] = {};      // why system calls are not limited; empty = they are
};

// To the decoder; `bytes` bytes follow.
struct DecodeRequest {
  DecodeOptions options = {};
  std::uint64_t bytes = 0;
};

// From the decoder; when `refused` is 0, width x height x channels pixels follow, and those of the
// thumbnail that was asked for.
struct DecodeAnswer {
  std::int32_t refused = 0;
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::int32_t channels = 0;
  std::int32_t original_width = 0;
  std::int32_t original_height = 0;
  std::int32_t format = 0;      // ImageFormat
  std::int32_t error_code = 0;  // ErrorCode
  char reason[40] = {};
  char message[440] = {};
};

static_assert(std::is_trivially_copyable_v<DecoderGreeting>);
static_assert(std::is_trivially_copyable_v<DecodeRequest>);
static_assert(std::is_trivially_copyable_v<DecodeAnswer>);

// Whether the program was started as a decoder.
bool IsDecoder(int argc, const char* const* argv);

// Decodes what comes through kDecoderSocket until the server closes it or ends. Call it before any
// thread is started. Returns the exit status.
int RunDecoder(int argc, const char* const* argv);

}  // namespace pliant::server
