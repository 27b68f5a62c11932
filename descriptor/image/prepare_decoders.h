// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// For a process that only decodes and cannot open files or start threads later, and for programs
// whose standard error is a log.
#pragma once

namespace pliant {

// Switches off OpenCV's log: an Error reports a damaged image.
void QuietDecoders();

// Switches off OpenCV's threads and decodes a small image of each format, so that the decoders
// finish all first-use work (loading, measuring, system calls). Throws what DecodeImage throws.
// Call it before starting threads.
void PrepareDecoders();

}  // namespace pliant
