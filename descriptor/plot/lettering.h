// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lines of text in the system's fonts: any writing for which a font is installed, joined and
// ordered as it is written (Arabic, Devanagari, right to left).
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace pliant {

// One line of text, drawn: how much of each pixel is ink.
struct Lettering {
  int left = 0,
      top = 0;  // of the first pixel, from the left end of the base line; `top` < 0 above it
  int width = 0, height = 0;
  int advance = 0;                // length of the line; ink may reach a little beyond
  std::vector<std::uint8_t> ink;  // height x width, row-major; 255 = covered
};

// Whether the system has a font that can be scaled. Without one, nothing here may be called.
bool HasFonts();

// `text`: UTF-8; line breaks and other control characters, bytes that are none, and characters that
// no font has become U+FFFD. `height_px`: of a capital letter, 1 or more. At most
// `kMaxLetters` characters are drawn. The first call looks for the fonts. Thread-safe.
Lettering DrawLetters(std::string_view text, int height_px);
int LetteringAdvance(std::string_view text, int height_px);

inline constexpr std::size_t kMaxLetters = 4096;

}  // namespace pliant
