// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// For a process that decodes and does nothing else, and that may open and start nothing later; and
// for programs whose standard error is a log.
#pragma once

namespace pliant {

// OpenCV logs nothing from now on: an Error says what is wrong with an image.
void QuietDecoders();

// OpenCV starts no threads from now on, and whatever the decoders load, measure or ask of the
// system when they are first used is done: a small image of each format is decoded. Throws what
// DecodeImage throws. Call it before starting threads.
void PrepareDecoders();

}  // namespace pliant
