// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// libpng and libjpeg print messages about damaged pictures to `stderr`, which OpenCV cannot
// disable. A program whose standard error is a log calls QuietDecoders() at its start. Output
// during decoding is then discarded, since the Error reports the problem; other output is kept.
#pragma once

namespace pliant {

// Replaces the C library's `stderr` stream (not the file descriptor, not std::cerr). Call it once,
// before starting threads. It does nothing where the C library does not allow this.
void QuietDecoders();

// During its lifetime the output of this thread to `stderr` is discarded, after QuietDecoders().
class DecoderSilence {
 public:
  DecoderSilence();
  ~DecoderSilence();
  DecoderSilence(const DecoderSilence&) = delete;
  DecoderSilence& operator=(const DecoderSilence&) = delete;
};

}  // namespace pliant
