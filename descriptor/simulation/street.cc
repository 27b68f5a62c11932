// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The preset street: small things in photographs of a scene.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "descriptor/simulation/artwork.h"
#include "descriptor/simulation/view.h"

namespace pliant::simulation {
namespace {

constexpr int kTries = 4;             // poses and cameras until enough of the print is seen
constexpr float kEnoughSeen = 0.35F;  // of the area that it would have flat
constexpr int kPrintPixels = 320;     // of the print's width on the cloth's texture

// What a scene shows and where on chart 0 it is.
struct Subject {
  bool printed = false;  // a drawing on cloth; otherwise the texture covers the object
  Artwork artwork;
  PrintPlace place;
  std::string name;
};

Body DrawStreetBody(const Subject& subject, float aspect, int cells, Random& random) {
  const float kind = random.Uniform();
  if (!subject.printed) {
    if (kind < 0.6F) return MakeSheet(aspect, cells);
    if (kind < 0.8F) return MakeTube(std::clamp(aspect, 0.5F, 1.6F), cells);
    return MakePillow(std::clamp(aspect, 0.6F, 1.6F), cells);
  }
  if (kind < 0.7F) return MakeShirt(random.Uniform(0.9F, 1.2F), cells, random);
  if (kind < 0.9F) return MakeSheet(random.Uniform(0.8F, 1.3F), cells);
  return MakePillow(random.Uniform(0.8F, 1.3F), cells);
}

PrintPlace DrawPlace(const Body& body, float aspect, Random& random) {
  const bool shirt = body.kind == BodyKind::kShirt;
  const Chart& chart = body.charts[0];
  float width = shirt ? random.Uniform(0.26F, 0.46F) : random.Uniform(0.35F, 0.8F);
  float height = width * aspect * chart.width / chart.height;
  const float tallest = shirt ? 0.55F : 0.85F;
  if (height > tallest) width *= tallest / std::exchange(height, tallest);
  const float u = 0.5F + random.Uniform(-0.04F, 0.04F);
  const float v = shirt ? 0.22F + 0.5F * height + random.Uniform(-0.03F, 0.08F)
                        : 0.5F + random.Uniform(-0.05F, 0.05F);
  return {{u - 0.5F * width, v - 0.5F * height}, {u + 0.5F * width, v + 0.5F * height}};
}

Subject DrawSubject(Stage& stage, Random& random) {
  Subject subject;
  const Texture& own = *stage.cast[0];
  subject.printed = random.Chance(stage.options.printed);
  subject.name = own.name();
  if (subject.printed) subject.artwork = DrawArtwork(random, &own);
  stage.body = DrawStreetBody(subject, own.aspect(), stage.options.cells, random);
  if (subject.printed) {
    subject.place = DrawPlace(stage.body, subject.artwork.aspect(), random);
  } else if (stage.body.kind == BodyKind::kTube) {
    subject.place = {{0.34F, 0.0F}, {0.66F, 1.0F}};
  } else {
    subject.place = {{0.0F, 0.0F}, {1.0F, 1.0F}};
  }
  return subject;
}

// One garment: its texture and relief must live as long as the views are taken.
struct Garment {
  std::shared_ptr<const Texture> texture;
  std::shared_ptr<const Relief> relief;
};

std::shared_ptr<const Texture> MakeCloth(const Stage& stage, const Subject& subject,
                                         const PrintOptions& print, Random& random) {
  const Chart& chart = stage.body.charts[0];
  const float share = subject.place.high.x() - subject.place.low.x();
  const int width = static_cast<int>(std::lround(kPrintPixels / share));
  const int height =
      static_cast<int>(std::lround(static_cast<float>(width) * chart.height / chart.width));
  const Image cloth = PrintOn(subject.artwork, subject.place, print, width, height, random);
  return std::make_shared<const Texture>(subject.name, cloth);
}

PrintOptions DrawPrint(const Artwork& artwork, Random& random) {
  PrintOptions print;
  print.cloth = artwork.ground;
  if (random.Chance(0.35F)) {  // the same drawing on another cloth, light on dark if it was before
    const Ink other = DrawClothColour(random);
    const bool same_side = Brighter(artwork, other) * Brighter(artwork, artwork.ground) > 0.0F;
    if (same_side && Contrast(artwork, other) > 0.12F) print.cloth = other;
  } else {
    const float fade = 0.06F * random.Normal();
    print.cloth = (print.cloth + fade).max(0.0F).min(1.0F);
  }
  print.opacity = random.Uniform(0.7F, 1.0F);
  print.fading = random.Chance(0.35F) ? random.Uniform(0.0F, 0.8F) : 0.0F;
  return print;
}

Colour LinearInk(const Ink& ink) {
  const Ink linear = ink.square();
  return {linear[0], linear[1], linear[2], 0.0F};
}

// Materials of all charts: the print in front, bare cloth behind. `flat`: as in a catalogue.
Garment Dress(Stage& stage, const Subject& subject, bool flat, Random& random) {
  Garment garment;
  PrintOptions print;
  if (subject.printed) {
    print.cloth = subject.artwork.ground;
    if (!flat) print = DrawPrint(subject.artwork, random);
    garment.texture = MakeCloth(stage, subject, print, random);
  }
  const Texture* shown = subject.printed ? garment.texture.get() : stage.cast[0].get();
  stage.materials.clear();
  for (std::size_t c = 0; c < stage.body.charts.size(); ++c) {
    Material material = DrawMaterial(c == 0 || !subject.printed ? shown : nullptr, random);
    if (subject.printed) {
      material.back = LinearInk(print.cloth);
      material.show_through *= 0.3F;
      material.gloss *= 0.2F;
      if (c > 0) material.tint = material.back;
    }
    stage.materials.push_back(material);
  }
  const bool wrinkled = !flat && (subject.printed || random.Chance(0.4F));
  if (wrinkled) {
    const Chart& chart = stage.body.charts[0];
    garment.relief = std::make_shared<const Relief>(random, chart.height / chart.width,
                                                    random.LogUniform(0.04F, 0.35F));
    const float turn = random.Angle();
    const float low = random.Uniform(0.3F, 1.2F);  // grazing light shows more
    for (Material& material : stage.materials) {
      material.relief = garment.relief.get();
      material.relief_light = low * Eigen::Array2f(std::cos(turn), std::sin(turn));
    }
  }
  return garment;
}

Focus DrawFocus(const Stage& stage, const Subject& subject, float enlarge, Random& random) {
  const auto w = static_cast<float>(stage.options.width);
  const auto h = static_cast<float>(stage.options.height);
  Focus focus;
  focus.place = subject.place;
  focus.width_px = w * std::min(0.75F, enlarge * random.LogUniform(stage.options.least_width,
                                                                   stage.options.most_width));
  focus.at = {w * random.Uniform(0.28F, 0.72F), h * random.Uniform(0.28F, 0.72F)};
  return focus;
}

Shot DrawStreetShot(const Stage& stage, const Subject& subject, Random& random) {
  const float strength = stage.options.strength;
  Shot shot;
  shot.strength = strength;
  shot.pose =
      Perform(stage.body, DrawMotion(stage.body, random, strength * random.Uniform(0.12F, 0.75F)));
  shot.framing = DrawFraming(random, 0.75F * strength);
  if (random.Chance(0.7F)) shot.framing.roll_deg = 14.0F * random.Normal();  // held upright
  shot.framing.distance = random.LogUniform(2.0F, 8.0F);
  shot.facing_u = random.Uniform(0.4F, 0.6F);
  shot.develop = DrawDevelop(random, strength);
  shot.focus = DrawFocus(stage, subject, shot.develop->enlarge, random);
  return shot;
}

// The artwork itself, without shading; an object that it covers is photographed calmly.
Shot CatalogueShot(const Stage& stage, const Subject& subject, Random& random) {
  const auto w = static_cast<float>(stage.options.width);
  const auto h = static_cast<float>(stage.options.height);
  Shot shot;
  shot.clear = true;
  shot.strength = 0.3F;
  shot.evenly_lit = subject.printed || random.Chance(0.5F);
  shot.pose = subject.printed ? Pose{"flat", stage.body.rest, {}, 0.0F}
                              : Perform(stage.body, DrawCalmMotion(stage.body, random));
  shot.framing = DrawFrontalFraming(random);
  if (subject.printed) shot.framing.roll_deg = shot.framing.tilt_deg = 0.0F;
  shot.develop = DrawDevelop(random, 0.3F);
  Focus focus;
  focus.place = subject.place;
  const Chart& chart = stage.body.charts[0];
  const Eigen::Array2f size =
      (subject.place.high - subject.place.low) * Eigen::Array2f(chart.width, chart.height);
  const float fill = random.Uniform(0.7F, 0.97F);
  focus.width_px = fill * std::min(w, h * size.x() / size.y());
  focus.at = {0.5F * w, 0.5F * h};
  shot.focus = focus;
  return shot;
}

// Part of the print's flat area that the view shows.
float PartSeen(const View& view, const Focus& focus, const Chart& chart) {
  const Eigen::Array2f low = focus.place.low * 65535.0F;
  const Eigen::Array2f high = focus.place.high * 65535.0F;
  std::size_t seen = 0;
  for (std::size_t i = 0; i < view.chart.size(); ++i) {
    if (view.chart[i] != 0) continue;
    const auto u = static_cast<float>(view.uv[2 * i]);
    const auto v = static_cast<float>(view.uv[2 * i + 1]);
    if (u >= low.x() && u <= high.x() && v >= low.y() && v <= high.y()) ++seen;
  }
  const Eigen::Array2f size =
      (focus.place.high - focus.place.low) * Eigen::Array2f(chart.width, chart.height);
  return static_cast<float>(seen) / (focus.width_px * focus.width_px * size.y() / size.x());
}

View TakeStreetView(Stage& stage, const Subject& subject, Random& random) {
  View best;
  float best_part = -1.0F;
  for (int attempt = 0; attempt < kTries && best_part < kEnoughSeen; ++attempt) {
    const Garment garment = Dress(stage, subject, false, random);
    const Shot shot = DrawStreetShot(stage, subject, random);
    View view = TakeView(stage, shot, random.Fork());
    // NOLINTNEXTLINE(bugprone-unchecked-optional-access): DrawStreetShot sets the focus
    const float part = PartSeen(view, *shot.focus, stage.body.charts[0]);
    if (part <= best_part) continue;
    best = std::move(view);
    best_part = part;
  }
  return best;
}

}  // namespace

void FillStreet(Stage& stage, Random& random, Scene& scene) {
  const Subject subject = DrawSubject(stage, random);
  for (std::size_t c = 0; c < stage.body.charts.size(); ++c) {
    const std::string plain = "cloth " + std::to_string(scene.seed) + '-' +
                              std::to_string(scene.index) + ' ' + std::to_string(c);
    // Surfaces of one name are taken to look alike; a drawing is of this scene only.
    scene.textures.push_back(subject.printed ? plain : subject.name);
  }
  {
    const Garment garment = Dress(stage, subject, true, random);
    scene.views.push_back(TakeView(stage, CatalogueShot(stage, subject, random), random.Fork()));
  }
  while (static_cast<int>(scene.views.size()) < stage.options.views)
    scene.views.push_back(TakeStreetView(stage, subject, random));
}

}  // namespace pliant::simulation
