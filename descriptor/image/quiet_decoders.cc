// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/image/quiet_decoders.h"

#include <cerrno>
#include <cstdio>

#include <opencv2/core/utils/logger.hpp>
#include <unistd.h>

namespace pliant {
namespace {

thread_local int silences = 0;

#ifdef __GLIBC__
ssize_t WriteUnlessSilent(void*, const char* text, size_t size) {
  if (silences > 0) return static_cast<ssize_t>(size);
  size_t written = 0;
  while (written < size) {
    const ssize_t n = ::write(STDERR_FILENO, text + written, size - written);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return 0;
    written += static_cast<size_t>(n);
  }
  return static_cast<ssize_t>(size);
}
#endif

}  // namespace

void QuietDecoders() {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
#ifdef __GLIBC__
  cookie_io_functions_t functions{};
  functions.write = WriteUnlessSilent;
  std::FILE* stream = fopencookie(nullptr, "w", functions);
  if (stream == nullptr) return;
  std::setvbuf(stream, nullptr, _IONBF, 0);  // so that each write is of the thread that printed
  stderr = stream;
#endif
}

DecoderSilence::DecoderSilence() { ++silences; }
DecoderSilence::~DecoderSilence() { --silences; }

}  // namespace pliant
