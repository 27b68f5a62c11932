// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/decoder/decoder_main.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <memory>
#include <new>
#include <string>
#include <string_view>

#include <malloc.h>
#include <sys/prctl.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "descriptor/image/image.h"
#include "server/decoder/sandbox.h"

namespace pliant::server {

namespace {

constexpr const char* kTooMuchMemory =
    "Decoding the image takes more memory than allowed. Scale it down, or save it as a "
    "non-progressive JPEG.";
constexpr int kArguments = 5;  // program, kDecoderArgument, server, memory, processor time

// Calls read() or write() until all is done. False: the stream has ended, there is no server.
template <typename Call, typename Byte>
bool All(Call call, Byte* data, std::size_t bytes) {
  while (bytes > 0) {
    const ssize_t n = call(kDecoderSocket, data, bytes);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    data += n;
    bytes -= static_cast<std::size_t>(n);
  }
  return true;
}

bool Read(void* to, std::size_t bytes) { return All(::read, static_cast<char*>(to), bytes); }

bool Write(const void* from, std::size_t bytes) {
  return All(::write, static_cast<const char*>(from), bytes);
}

bool Write(const Image& image) { return Write(image.pixels.data(), image.pixels.size()); }

// Cut off where there is no room; the field ends with a zero.
template <std::size_t kSize>
void Copy(const std::string& text, char (&field)[kSize]) {
  std::memcpy(field, text.data(), std::min(text.size(), kSize - 1));
}

DecodeAnswer Refusal(ErrorCode code, const std::string& reason, const std::string& message) {
  DecodeAnswer answer{.refused = 1, .error_code = static_cast<std::int32_t>(code)};
  Copy(reason, answer.reason);
  Copy(message, answer.message);
  return answer;
}

DecodeAnswer Decode(Bytes bytes, const DecodeOptions& options, DecodedImage* decoded) {
  try {
    *decoded = DecodeImage(bytes, options);
    return {.width = decoded->image.width,
            .height = decoded->image.height,
            .channels = decoded->image.channels,
            .original_width = decoded->original_width,
            .original_height = decoded->original_height,
            .format = static_cast<std::int32_t>(decoded->format)};
  } catch (const Error& error) {
    return Refusal(error.code(), error.reason(), error.what());
  } catch (const std::bad_alloc&) {
    return Refusal(ErrorCode::kTooLarge, "image_too_large", kTooMuchMemory);
  } catch (const std::exception& error) {
    return Refusal(ErrorCode::kUnprocessable, "image_corrupt",
                   std::string("The image cannot be decoded: ") + error.what());
  }
}

// False when there is no server any more.
bool DecodeNext() {
  DecodeRequest request;
  if (!Read(&request, sizeof(request))) return false;
  const std::unique_ptr<std::uint8_t[]> bytes(new (std::nothrow) std::uint8_t[request.bytes]);
  if (!bytes) {  // the file stays unread, so the next request cannot be found
    const DecodeAnswer answer = Refusal(ErrorCode::kTooLarge, "image_too_large", kTooMuchMemory);
    Write(&answer, sizeof(answer));
    return false;
  }
  if (!Read(bytes.get(), request.bytes)) return false;
  DecodedImage decoded;
  const DecodeAnswer answer = Decode({bytes.get(), request.bytes}, request.options, &decoded);
  return Write(&answer, sizeof(answer)) && Write(decoded.image) && Write(decoded.thumbnail);
}

}  // namespace

bool IsDecoder(int argc, const char* const* argv) {
  return argc == kArguments && std::string_view(argv[1]) == kDecoderArgument;
}

int RunDecoder(int /*argc*/, const char* const* argv) {
  // Ends with the thread that started it, whatever it is doing then.
  if (prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0) != 0 || getppid() != std::atoi(argv[2])) return 1;
  // The next image finds the memory that this one took: no second arena, which reserves what the
  // limit counts, and large blocks go back at once (mallopt(3)).
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  // If the machine is short of memory, the system ends this before the server (proc(5)).
  std::ofstream("/proc/self/oom_score_adj") << 1000;
  const SandboxLimits limits{.memory_bytes = std::atoll(argv[3]), .cpu_s = std::atoll(argv[4])};
  DecoderGreeting greeting;
  try {
    PrepareForSandbox();
    Copy(EnterSandbox(kDecoderSocket, limits), greeting.text);
    greeting.ready = 1;
  } catch (const std::exception& error) {
    Copy(error.what(), greeting.text);
  }
  if (!Write(&greeting, sizeof(greeting)) || greeting.ready == 0) return 1;
  while (DecodeNext()) {
  }
  return 0;
}

}  // namespace pliant::server
