// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lines of text in the system's fonts, laid out by Pango: any script for which a font is installed,
// right to left where the script is.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace pliant {

// One line of text, drawn: how much of each pixel is ink.
struct Lettering {
  int left = 0, top = 0;  // of the first pixel, from the left end of the baseline; y points down
  int width = 0, height = 0;
  int advance = 0;                // length of the line; ink can reach a little beyond
  std::vector<std::uint8_t> ink;  // height x width, row-major; 255 = covered
};

// Whether the system has a font. Without one, do not call DrawLetters.
bool HasFonts();

// `text`: UTF-8. Control characters and invalid bytes become U+FFFD; text beyond kMaxLetters
// characters is dropped. `height_px`: of a capital letter, 1 or more. Thread-safe.
Lettering DrawLetters(std::string_view text, int height_px);

inline constexpr std::size_t kMaxLetters = 4096;

}  // namespace pliant
