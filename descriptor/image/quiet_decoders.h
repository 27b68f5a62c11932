// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// libpng and libjpeg print what is wrong with a damaged picture on `stderr` and cannot be told
// otherwise through OpenCV. A program whose standard error is a log calls QuietDecoders() first:
// then what is printed while a picture is decoded is dropped, since the Error says it. Everything
// else goes through unchanged.
#pragma once

namespace pliant {

// Replaces the C library's `stderr` stream (not the file descriptor, not std::cerr). Once, before
// any thread. Where the C library does not allow it, nothing happens.
void QuietDecoders();

// While it lives, what this thread prints on `stderr` is dropped, after QuietDecoders().
class DecoderSilence {
 public:
  DecoderSilence();
  ~DecoderSilence();
  DecoderSilence(const DecoderSilence&) = delete;
  DecoderSilence& operator=(const DecoderSilence&) = delete;
};

}  // namespace pliant
