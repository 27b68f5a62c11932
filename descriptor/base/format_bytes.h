// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace pliant {

// For people: "178 bytes", "64 KiB", "1.5 MiB".
std::string FormatBytes(std::uint64_t bytes);

}  // namespace pliant
