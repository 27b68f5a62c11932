// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/plot/lettering.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <new>
#include <string>

#include <fontconfig/fontconfig.h>
#include <raqm.h>
#include FT_OUTLINE_H
#include FT_TRUETYPE_TABLES_H

#include "descriptor/base/error.h"
#include "descriptor/base/utf8.h"

namespace pliant {
namespace {

constexpr double kUnits = 64;           // FreeType counts in 64ths of a pixel
constexpr double kUsualCapital = 0.72;  // height of a capital letter, where a font does not say it
constexpr char32_t kUnknown = U'\uFFFD';  // drawn in place of what cannot be
constexpr FT_Int32 kLoad = FT_LOAD_NO_BITMAP | FT_LOAD_TARGET_LIGHT;

struct DestroyRaqm {
  void operator()(raqm_t* line) const { raqm_destroy(line); }
};

// A font of the system; its file is opened when a character needs it.
struct Font {
  std::string file;
  int index = 0;
  bool tried = false;
  FT_Face face = nullptr;  // stays null when the file cannot be used
};

// The fonts in the order in which the system prefers them for text without serifs; those after the
// first serve characters that the ones before lack.
class Fonts {
 public:
  Fonts() {
    if (FT_Init_FreeType(&library_) != 0) return;
    FcPattern* wanted = FcPatternCreate();
    if (wanted == nullptr) return;
    FcPatternAddString(wanted, FC_FAMILY, reinterpret_cast<const FcChar8*>("sans-serif"));
    FcPatternAddBool(wanted, FC_SCALABLE, FcTrue);
    FcConfigSubstitute(nullptr, wanted, FcMatchPattern);
    FcDefaultSubstitute(wanted);
    FcResult result = FcResultNoMatch;
    if (FcFontSet* found = FcFontSort(nullptr, wanted, FcTrue, nullptr, &result)) {
      for (int i = 0; i < found->nfont; ++i) Take(found->fonts[i]);
      FcFontSetDestroy(found);
    }
    FcPatternDestroy(wanted);
    std::erase_if(fonts_, [](const Font& font) { return font.file.empty(); });
    // The first must be one that works.
    while (!fonts_.empty() && Open(fonts_.front()) == nullptr) fonts_.erase(fonts_.begin());
  }

  bool empty() const { return fonts_.empty(); }

  // The first font that has the character, or null. `usual`: the one before, which neighbours keep
  // where it has them.
  FT_Face For(char32_t point, FT_Face usual) {
    if (usual != nullptr && FT_Get_Char_Index(usual, point) != 0) return usual;
    for (Font& font : fonts_) {
      const FT_Face face = Open(font);
      if (face != nullptr && FT_Get_Char_Index(face, point) != 0) return face;
    }
    return nullptr;
  }

  FT_Face first() const { return fonts_.front().face; }

 private:
  void Take(FcPattern* pattern) {
    FcChar8* file = nullptr;
    int index = 0;
    if (FcPatternGetString(pattern, FC_FILE, 0, &file) != FcResultMatch) return;
    FcPatternGetInteger(pattern, FC_INDEX, 0, &index);
    fonts_.push_back({reinterpret_cast<const char*>(file), index});
  }

  FT_Face Open(Font& font) {
    if (font.tried) return font.face;
    font.tried = true;
    FT_Face face = nullptr;
    if (FT_New_Face(library_, font.file.c_str(), font.index, &face) != 0) return nullptr;
    if (FT_IS_SCALABLE(face) && FT_Select_Charmap(face, FT_ENCODING_UNICODE) == 0) {
      font.face = face;
    } else {
      FT_Done_Face(face);
    }
    return font.face;
  }

  FT_Library library_ = nullptr;
  std::vector<Font> fonts_;
};

// Never destroyed: threads may draw while the program ends.
Fonts& SystemFonts() {
  static auto* const fonts = new Fonts;
  return *fonts;
}

// FreeType's faces hold the size and the letter at hand, so that one line is drawn at a time.
std::mutex& Turn() {
  static auto* const turn = new std::mutex;
  return *turn;
}

void SetCapitalHeight(FT_Face face, int height_px) {
  double capital = kUsualCapital;
  const auto* table = static_cast<const TT_OS2*>(FT_Get_Sfnt_Table(face, FT_SFNT_OS2));
  if (table != nullptr && table->version >= 2 && table->sCapHeight > 0 && face->units_per_EM > 0) {
    capital = static_cast<double>(table->sCapHeight) / face->units_per_EM;
  }
  const double em = std::clamp(kUnits * height_px / capital, kUnits, 1000 * kUnits);
  FT_Set_Char_Size(face, 0, std::lround(em), 72, 72);
}

// The text as it can be drawn, and the font of each character.
struct Line {
  std::u32string text;
  std::vector<FT_Face> faces;
};

Line FindFonts(std::string_view utf8, int height_px, Fonts& fonts) {
  Line line{DecodeUtf8(utf8.substr(0, 4 * kMaxLetters)), {}};
  if (line.text.size() > kMaxLetters) line.text.resize(kMaxLetters);
  FT_Face face = nullptr;
  std::vector<FT_Face> sized;
  for (char32_t& point : line.text) {
    if (point < 0x20 || (point >= 0x7F && point < 0xA0)) point = kUnknown;
    FT_Face found = fonts.For(point, face);
    if (found == nullptr) {
      const FT_Face unknown = fonts.For(kUnknown, fonts.first());
      point = unknown != nullptr ? kUnknown : U'?';
      found = unknown != nullptr ? unknown : fonts.first();
    }
    face = found;
    line.faces.push_back(face);
    if (std::find(sized.begin(), sized.end(), face) == sized.end()) {
      SetCapitalHeight(face, height_px);
      sized.push_back(face);
    }
  }
  return line;
}

using RaqmLine = std::unique_ptr<raqm_t, DestroyRaqm>;

// Glyphs in the order in which they stand, with their places.
RaqmLine LayOut(const Line& line) {
  RaqmLine laid(raqm_create());
  if (!laid) throw std::bad_alloc();
  const std::vector<std::uint32_t> points(line.text.begin(), line.text.end());
  bool good = raqm_set_text(laid.get(), points.data(), points.size()) &&
              raqm_set_par_direction(laid.get(), RAQM_DIRECTION_DEFAULT) &&
              raqm_set_freetype_load_flags(laid.get(), kLoad);
  for (std::size_t begin = 0; good && begin < line.faces.size();) {
    std::size_t end = begin + 1;
    while (end < line.faces.size() && line.faces[end] == line.faces[begin]) ++end;
    good = raqm_set_freetype_face_range(laid.get(), line.faces[begin], begin, end - begin);
    begin = end;
  }
  if (!good || !raqm_layout(laid.get())) {
    throw Error(ErrorCode::kInternal, "text_not_drawn", "A line of text could not be laid out");
  }
  return laid;
}

// The ink of one glyph, which FreeType holds until the next; null for what has none (a space).
const FT_Bitmap* Render(const raqm_glyph_t& glyph, double x) {
  const FT_GlyphSlot slot = glyph.ftface->glyph;
  if (FT_Load_Glyph(glyph.ftface, glyph.index, kLoad) != 0) return nullptr;
  if (slot->format == FT_GLYPH_FORMAT_OUTLINE) {
    FT_Outline_Translate(&slot->outline, std::lround(x - kUnits * std::floor(x / kUnits)), 0);
  }
  if (FT_Render_Glyph(slot, FT_RENDER_MODE_NORMAL) != 0) return nullptr;
  const FT_Bitmap& bitmap = slot->bitmap;
  const bool grey = bitmap.pixel_mode == FT_PIXEL_MODE_GRAY && bitmap.buffer != nullptr;
  return grey && bitmap.width > 0 && bitmap.rows > 0 ? &bitmap : nullptr;
}

struct Placed {
  int x = 0, y = 0;  // of the first pixel, from the left end of the base line
  int width = 0, height = 0;
  std::vector<std::uint8_t> ink;
};

std::vector<Placed> RenderAll(raqm_t* laid, double* advance) {
  std::vector<Placed> placed;
  std::size_t count = 0;
  const raqm_glyph_t* glyphs = raqm_get_glyphs(laid, &count);
  double x = 0, y = 0;  // 64ths of a pixel; y upwards
  for (std::size_t i = 0; i < count; ++i) {
    const double at = x + glyphs[i].x_offset;
    const double up = y + glyphs[i].y_offset;
    if (const FT_Bitmap* bitmap = Render(glyphs[i], at)) {
      const FT_GlyphSlot slot = glyphs[i].ftface->glyph;
      Placed one{static_cast<int>(std::floor(at / kUnits)) + slot->bitmap_left,
                 -static_cast<int>(std::lround(up / kUnits)) - slot->bitmap_top,
                 static_cast<int>(bitmap->width),
                 static_cast<int>(bitmap->rows),
                 {}};
      for (int row = 0; row < one.height; ++row) {
        const unsigned char* from =
            bitmap->buffer + static_cast<std::ptrdiff_t>(row) * bitmap->pitch;
        one.ink.insert(one.ink.end(), from, from + one.width);
      }
      placed.push_back(std::move(one));
    }
    x += glyphs[i].x_advance;
    y += glyphs[i].y_advance;
  }
  *advance = x / kUnits;
  return placed;
}

Lettering Join(const std::vector<Placed>& placed, double advance) {
  Lettering line;
  line.advance = static_cast<int>(std::ceil(advance));
  if (placed.empty()) return line;
  int right = placed[0].x, bottom = placed[0].y;
  line.left = right;
  line.top = bottom;
  for (const Placed& one : placed) {
    line.left = std::min(line.left, one.x);
    line.top = std::min(line.top, one.y);
    right = std::max(right, one.x + one.width);
    bottom = std::max(bottom, one.y + one.height);
  }
  line.width = right - line.left;
  line.height = bottom - line.top;
  line.ink.resize(static_cast<std::size_t>(line.width) * line.height);
  for (const Placed& one : placed) {
    for (int row = 0; row < one.height; ++row) {
      std::uint8_t* to = line.ink.data() +
                         static_cast<std::size_t>(one.y + row - line.top) * line.width +
                         (one.x - line.left);
      const std::uint8_t* from = one.ink.data() + static_cast<std::size_t>(row) * one.width;
      std::transform(from, from + one.width, to, to,
                     [](std::uint8_t a, std::uint8_t b) { return std::max(a, b); });
    }
  }
  return line;
}

}  // namespace

bool HasFonts() {
  const std::lock_guard lock(Turn());
  return !SystemFonts().empty();
}

Lettering DrawLetters(std::string_view text, int height_px) {
  const std::lock_guard lock(Turn());
  const Line line = FindFonts(text, height_px, SystemFonts());
  if (line.text.empty()) return {};
  const RaqmLine laid = LayOut(line);
  double advance = 0;
  const std::vector<Placed> placed = RenderAll(laid.get(), &advance);
  return Join(placed, advance);
}

int LetteringAdvance(std::string_view text, int height_px) {
  const std::lock_guard lock(Turn());
  const Line line = FindFonts(text, height_px, SystemFonts());
  if (line.text.empty()) return 0;
  const RaqmLine laid = LayOut(line);
  std::size_t count = 0;
  const raqm_glyph_t* glyphs = raqm_get_glyphs(laid.get(), &count);
  double advance = 0;
  for (std::size_t i = 0; i < count; ++i) advance += glyphs[i].x_advance;
  return static_cast<int>(std::ceil(advance / kUnits));
}

}  // namespace pliant
