// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant-server keys create | list | revoke | purge
#pragma once

namespace pliant::server {

// `argv[0]` is the word "keys". Returns the exit status: 0 done, 1 failed, 2 wrong usage.
int RunKeysCommand(int argc, const char* const* argv);

}  // namespace pliant::server
