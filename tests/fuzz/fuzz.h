// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What the fuzz targets share. A target is a function of bytes that returns when the parser kept
// its promises, and ends the program when it did not (tests/README.md, Fuzzing).
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "descriptor/base/error.h"

// Called by libFuzzer, or by replay_main.cc. Returns 0.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace pliant::fuzz {

using Input = std::span<const std::uint8_t>;

// Ends the program, so that the input is reported, unless what was promised holds.
inline void Require(bool holds, const char* promise) {
  if (holds) return;
  std::fprintf(stderr, "broken: %s\n", promise);
  std::abort();
}

inline std::string_view TextOf(Input bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// Whether `work` returns. It may throw an Error that blames the input; anything else ends the
// program.
template <typename Work>
bool Accepts(Work&& work) {
  try {
    work();
    return true;
  } catch (const Error& error) {
    Require(error.code() != ErrorCode::kInternal, "no input is a defect of Pliant");
    Require(!error.reason().empty() && *error.what() != '\0', "an error says what is wrong");
    return false;
  }
}

// Takes the first byte off `input`; 0 when there is none.
inline std::uint8_t TakeByte(Input& input) {
  if (input.empty()) return 0;
  const std::uint8_t first = input.front();
  input = input.subspan(1);
  return first;
}

// Takes a line off `text`, without its end.
inline std::string_view TakeLine(std::string_view& text) {
  const std::size_t end = text.find('\n');
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return line;
}

inline std::vector<std::uint8_t> CopyOf(Input bytes) { return {bytes.begin(), bytes.end()}; }

}  // namespace pliant::fuzz
