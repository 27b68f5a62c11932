// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// For a process that decodes and does nothing else, and that may open and start nothing later.
#pragma once

namespace pliant {

// OpenCV starts no threads from now on, and whatever the decoders load, measure or ask of the
// system when they are first used is done: a small picture of each format is decoded. Throws what
// DecodeImage throws. Call it before starting threads.
void PrepareDecoders();

}  // namespace pliant
