// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/plot/lettering.h"

#include <memory>
#include <mutex>
#include <string>

#include <pango/pangoft2.h>

#include "descriptor/base/utf8.h"

namespace pliant {
namespace {

constexpr double kCapitalPerEm = 0.72;  // of usual fonts without serifs (DejaVu Sans: 0.729)
constexpr int kMargin_px = 1;           // around the ink, which Pango rounds

struct Unref {
  void operator()(void* object) const { g_object_unref(object); }
};
struct FreeFont {
  void operator()(PangoFontDescription* font) const { pango_font_description_free(font); }
};
using Layout = std::unique_ptr<PangoLayout, Unref>;
using Font = std::unique_ptr<PangoFontDescription, FreeFont>;

// Pango's fonts are for one thread at a time. Never destroyed: threads can draw while the program
// ends.
std::mutex& Turn() {
  static auto* const turn = new std::mutex;
  return *turn;
}

PangoContext* System() {
  static PangoContext* const context = pango_font_map_create_context(pango_ft2_font_map_new());
  return context;
}

Font SansSerif(int height_px) {
  Font font(pango_font_description_from_string("sans-serif"));
  pango_font_description_set_absolute_size(font.get(), PANGO_SCALE * height_px / kCapitalPerEm);
  return font;
}

std::string Drawable(std::string_view utf8) {
  std::u32string text = DecodeUtf8(utf8.substr(0, 4 * kMaxLetters));
  if (text.size() > kMaxLetters) text.resize(kMaxLetters);
  for (char32_t& point : text) {
    if (point < 0x20 || (point >= 0x7F && point < 0xA0)) point = U'\uFFFD';
  }
  return EncodeUtf8(text);
}

}  // namespace

bool HasFonts() {
  const std::lock_guard lock(Turn());
  static const bool has = [] {
    const std::unique_ptr<PangoFont, Unref> font(
        pango_context_load_font(System(), SansSerif(10).get()));
    return font != nullptr;
  }();
  return has;
}

Lettering DrawLetters(std::string_view text, int height_px) {
  const std::lock_guard lock(Turn());
  const Layout layout(pango_layout_new(System()));
  const std::string drawable = Drawable(text);
  pango_layout_set_font_description(layout.get(), SansSerif(height_px).get());
  pango_layout_set_single_paragraph_mode(layout.get(), TRUE);
  pango_layout_set_text(layout.get(), drawable.data(), static_cast<int>(drawable.size()));
  PangoLayoutLine* const line = pango_layout_get_line_readonly(layout.get(), 0);
  PangoRectangle ink{};
  PangoRectangle logical{};
  pango_layout_line_get_pixel_extents(line, &ink, &logical);
  Lettering letters;
  letters.advance = logical.width;
  if (ink.width <= 0 || ink.height <= 0) return letters;
  letters.left = ink.x - kMargin_px;
  letters.top = ink.y - kMargin_px;
  letters.width = ink.width + 2 * kMargin_px;
  letters.height = ink.height + 2 * kMargin_px;
  letters.ink.resize(static_cast<std::size_t>(letters.width) * letters.height);
  FT_Bitmap bitmap{};
  bitmap.rows = static_cast<unsigned>(letters.height);
  bitmap.width = static_cast<unsigned>(letters.width);
  bitmap.pitch = letters.width;
  bitmap.buffer = letters.ink.data();
  bitmap.num_grays = 256;
  bitmap.pixel_mode = FT_PIXEL_MODE_GRAY;
  pango_ft2_render_layout_line(&bitmap, line, -letters.left, -letters.top);
  return letters;
}

}  // namespace pliant
