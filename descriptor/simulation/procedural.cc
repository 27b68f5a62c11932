// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/procedural.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "descriptor/base/error.h"
#include "descriptor/simulation/procedural_painters.h"

namespace pliant::simulation {

std::string ToString(ProceduralKind kind) {
  constexpr std::array<std::string_view, kProceduralKinds> kNames = {
      "lettering", "logo", "checks", "floral", "woven", "newspaper", "packaging", "map"};
  return std::string(kNames[static_cast<std::size_t>(kind)]);
}

Image PaintProcedural(ProceduralKind kind, std::uint64_t seed, int side_px) {
  Random random(seed, 1000 + static_cast<std::uint64_t>(kind));
  const float aspect = random.LogUniform(0.65F, 1.5F);
  const int width = std::max(16, static_cast<int>(std::lround(static_cast<float>(side_px) *
                                                              std::min(1.0F, 1.0F / aspect))));
  const int height = std::max(
      16, static_cast<int>(std::lround(static_cast<float>(side_px) * std::min(1.0F, aspect))));
  const Palette palette(random);
  Canvas canvas(width, height, palette.paper);
  using Painter = void (*)(Canvas&, Random&, const Palette&);
  constexpr std::array<Painter, kProceduralKinds> kPainters = {
      PaintLettering, PaintLogo,      PaintChecks,    PaintFloral,
      PaintWoven,     PaintNewspaper, PaintPackaging, PaintMap};
  kPainters[static_cast<std::size_t>(kind)](canvas, random, palette);
  Mottle(canvas, random, 0.12F, 40.0F);
  return canvas.ToImage();
}

TextureSource ProceduralTextures(int count, std::uint64_t seed, int side_px) {
  if (count < 1) {
    throw Error(ErrorCode::kInvalidArgument, "option_out_of_range",
                "the number of procedural textures must be at least 1");
  }
  TextureSource source;
  for (int i = 0; i < count; ++i) {
    const auto kind = static_cast<ProceduralKind>(i % kProceduralKinds);
    std::array<char, 16> number{};
    std::snprintf(number.data(), number.size(), "-%04d", i);
    source.Add("procedural/" + ToString(kind) + number.data(),
               PaintProcedural(kind, seed + static_cast<std::uint64_t>(i), side_px));
  }
  return source;
}

}  // namespace pliant::simulation
