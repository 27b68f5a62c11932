// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Lines, dots and text on colour images: matches, outlines, meshes. Everything is clipped at the
// image's border and anti-aliased. Points are in pixels, pixel centres at integers. The images
// drawn on must have 3 channels: kInvalidArgument otherwise. Thread-safe for different images.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "descriptor/image/image.h"
#include "descriptor/warp/tps.h"

namespace pliant {

struct Colour {
  std::uint8_t red = 0, green = 0, blue = 0;
  bool operator==(const Colour&) const = default;
};

namespace colours {
inline constexpr Colour kBlack{0, 0, 0};
inline constexpr Colour kWhite{255, 255, 255};
inline constexpr Colour kGrey{128, 128, 128};
inline constexpr Colour kGreen{40, 220, 90};
inline constexpr Colour kRed{235, 60, 50};
inline constexpr Colour kYellow{250, 205, 40};
inline constexpr Colour kBlue{60, 140, 250};
}  // namespace colours

// The i-th of a cyclic list of colours that are easy to distinguish on white and on black.
Colour DistinctColour(std::size_t i);

// An image of one colour, 3 channels.
Image BlankImage(int width, int height, Colour colour = colours::kBlack);

// A copy with 3 channels, to draw on.
Image ToColour(const Image& image);

void DrawLine(Image& on, Vec2 from, Vec2 to, Colour colour, int thickness_px = 1);
void DrawPolyline(Image& on, std::span<const Vec2> points, bool closed, Colour colour,
                  int thickness_px = 1);
void DrawDot(Image& on, Vec2 centre, double radius_px, Colour colour);
void FillBox(Image& on, int x, int y, int width, int height, Colour colour);

// Whether the system has a font.
bool HasFonts();

// One line of UTF-8 that starts at (`left`, `baseline`), in the system's fonts: any script that has
// a font. `height_px`: of a capital letter, 1 or more. Control characters and invalid bytes are
// replaced by U+FFFD. Without fonts, which Debian's Pango depends on, nothing is written.
void DrawText(Image& on, int left, int baseline, const std::string& text, Colour colour,
              int height_px = 12);
// Width of one line in pixels; 0 without fonts.
int TextWidth(const std::string& text, int height_px = 12);

// Copies `what` (grey or colour) so that its top left pixel is (x, y) of `onto`.
void PasteImage(Image& onto, const Image& what, int x, int y);

}  // namespace pliant
