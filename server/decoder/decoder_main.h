// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The program as a decoder: what DecoderProcess starts.
#pragma once

namespace pliant::server {

// Whether the program was started as a decoder.
bool IsDecoder(int argc, const char* const* argv);

// Decodes what comes through kDecoderSocket until the server closes it or ends. Call it before any
// thread is started. Returns the exit status.
int RunDecoder(int argc, const char* const* argv);

}  // namespace pliant::server
