// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace pliant {

std::int64_t NowMs();  // Unix time

// In UTC, as strftime writes it: whole seconds.
std::string FormatUtc(std::int64_t unix_ms, const char* format);

}  // namespace pliant
