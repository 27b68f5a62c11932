// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/simulation/view.h"

namespace pliant::simulation {
namespace {

constexpr int kTries = 6;                 // cameras until enough of the object is seen
constexpr double kEnoughCoverage = 0.05;  // of the image

Body DrawBody(Preset preset, float aspect, int cells, Random& random) {
  const float draw = random.Uniform();
  if (preset == Preset::kPlanar || draw < 0.64F) return MakeSheet(aspect, cells);
  if (draw < 0.76F) return MakeTube(std::clamp(aspect, 0.5F, 1.6F), cells);
  if (draw < 0.88F) return MakePillow(std::clamp(aspect, 0.6F, 1.6F), cells);
  return MakeShirt(std::clamp(aspect, 0.9F, 1.2F), cells, random);
}

Shot DrawShot(const Stage& stage, Random& random) {
  const float strength = stage.options.strength;
  Shot shot;
  shot.strength = strength;
  if (stage.options.preset == Preset::kPlanar) {
    shot.pose = {"flat", stage.body.rest, {}, 0.0F};
  } else {
    shot.pose =
        Perform(stage.body, DrawMotion(stage.body, random, strength * random.Uniform(0.35F, 1.0F)));
  }
  shot.framing = DrawFraming(random, strength);
  shot.facing_u = random.Uniform(0.3F, 0.7F);
  return shot;
}

// Looks again, and at last simulates again, when too little of the object can be seen.
View TakeDeformedView(const Stage& stage, Random& random) {
  View best;
  double best_coverage = -1.0;
  Shot shot = DrawShot(stage, random);
  for (int attempt = 0; attempt < kTries; ++attempt) {
    View view = TakeView(stage, shot, random.Fork());
    const double coverage = Coverage(view.chart);
    if (coverage > best_coverage) {
      best = std::move(view);
      best_coverage = coverage;
    }
    if (best_coverage >= kEnoughCoverage) break;
    shot = DrawShot(stage, random);
    shot.framing.scale = std::max(shot.framing.scale, 0.6F);
  }
  return best;
}

Shot CalmShot(const Stage& stage, Random& random) {
  Shot shot;
  shot.clear = true;
  shot.strength = 0.35F;
  shot.pose = stage.options.preset == Preset::kPlanar
                  ? Pose{"flat", stage.body.rest, {}, 0.0F}
                  : Perform(stage.body, DrawCalmMotion(stage.body, random));
  shot.framing = DrawFrontalFraming(random);
  return shot;
}

// One deformed pose, with one setting changed from view to view.
void TakeSweep(const Stage& stage, Random& random, Scene& scene) {
  const int count = stage.options.views - 1;
  Shot shot;
  shot.clear = true;
  shot.strength = 0.6F * stage.options.strength;
  shot.pose = Perform(stage.body, DrawMotion(stage.body, random, 0.5F * stage.options.strength));
  shot.framing = DrawFrontalFraming(random);
  shot.framing.tilt_deg = random.Uniform(0.0F, 25.0F);
  shot.framing.shift_x = shot.framing.shift_y = 0.0F;
  const Random same = random.Fork();  // same surroundings and light in every view
  for (int i = 0; i < count; ++i) {
    const float t = count > 1 ? static_cast<float>(i) / (count - 1) : 0.0F;
    if (stage.options.preset == Preset::kRotation) {
      shot.framing.roll_deg = 180.0F * t;
      shot.framing.scale = 0.75F;  // so that no corner leaves the image
    } else {
      shot.framing.scale = std::pow(0.25F, t);
    }
    scene.views.push_back(TakeView(stage, shot, same));
  }
}

void TakeSequence(const Stage& stage, Random& random, Scene& scene) {
  const int count = stage.options.views - 1;
  Motion motion =
      DrawMotion(stage.body, random, stage.options.strength * random.Uniform(0.5F, 1.0F));
  const std::vector<Pose> poses = PerformSequence(stage.body, motion, count, 2);
  Framing framing = DrawFrontalFraming(random);
  Framing last = framing;
  last.roll_deg +=
      (random.Chance(0.5F) ? 1.0F : -1.0F) * random.Uniform(0.3F, 1.0F) * stage.options.turn_deg;
  last.tilt_deg = random.Uniform(0.0F, 40.0F);
  framing.scale = random.Uniform(0.6F, 0.85F);
  last.scale = random.LogUniform(stage.options.least_scale, 1.0F);
  const Random same = random.Fork();
  for (int i = 0; i < count; ++i) {
    const float t = count > 1 ? static_cast<float>(i) / (count - 1) : 0.0F;
    Shot shot;
    shot.strength = 0.5F * stage.options.strength;
    shot.pose = poses[i];
    shot.framing = framing;
    shot.framing.roll_deg += t * (last.roll_deg - framing.roll_deg);
    shot.framing.tilt_deg += t * (last.tilt_deg - framing.tilt_deg);
    shot.framing.scale += t * (last.scale - framing.scale);
    scene.views.push_back(TakeView(stage, std::move(shot), same));
  }
}

struct PresetRow {
  Preset preset;
  std::string_view name;
  int views;
};
constexpr std::array kPresets = std::to_array<PresetRow>({
    {Preset::kPairs, "pairs", 5},
    {Preset::kObjects, "objects", 11},
    {Preset::kSequence, "sequence", 61},
    {Preset::kRotation, "rotation", 20},  // 0, 10, ... 180 degrees
    {Preset::kScale, "scale", 10},
    {Preset::kPlanar, "planar", 5},
    {Preset::kStreet, "street", 5},
});

const PresetRow& RowOf(Preset preset) {
  return *std::ranges::find(kPresets, preset, &PresetRow::preset);
}

void Require(bool condition, const char* field, const char* range) {
  if (condition) return;
  throw Error(ErrorCode::kInvalidArgument, "option_out_of_range",
              std::string(field) + " must be " + range);
}

// The views of every preset but street.
void FillScene(Stage& stage, Random& random, Scene& scene, const std::function<Cast()>& draw_cast) {
  const SceneOptions& options = stage.options;
  stage.body = DrawBody(options.preset, stage.cast[0]->aspect(), options.cells, random);
  for (std::size_t c = 0; c < stage.body.charts.size(); ++c) {
    const Texture* other = c == 0 ? nullptr : AnyOther(stage.cast, random);
    stage.materials.push_back(DrawMaterial(other != nullptr ? other : stage.cast[0].get(), random));
    scene.textures.push_back(stage.materials.back().texture->name());
  }
  scene.views.push_back(TakeView(stage, CalmShot(stage, random), random.Fork()));
  if (options.preset == Preset::kSequence) {
    TakeSequence(stage, random, scene);
  } else if (options.preset == Preset::kRotation || options.preset == Preset::kScale) {
    TakeSweep(stage, random, scene);
  } else {
    while (static_cast<int>(scene.views.size()) < options.views) {
      // Each view of an object at a place of its own.
      if (options.preset == Preset::kObjects) stage.cast = draw_cast();
      scene.views.push_back(TakeDeformedView(stage, random));
    }
  }
}

}  // namespace

Scene MakeScene(const TextureSource& textures, const SceneOptions& wanted, std::uint64_t seed,
                std::uint64_t index) {
  SceneOptions options = wanted;
  Validate(options);
  if (options.views == 0) options.views = DefaultViews(options.preset);
  if (textures.size() == 0) {
    throw Error(ErrorCode::kInvalidArgument, "textures_missing",
                "the simulation needs at least one texture");
  }
  Random random(seed, index);
  const auto draw_cast = [&] { return DrawCast(textures, options.preset, seed, index, random); };
  const Cast first_cast = draw_cast();  // the materials point into it
  Stage stage{first_cast, options, {}, {}};
  Scene scene;
  scene.preset = options.preset;
  scene.seed = seed;
  scene.index = index;
  if (options.preset == Preset::kStreet) {
    FillStreet(stage, random, scene);
  } else {
    FillScene(stage, random, scene, draw_cast);
  }
  scene.kind = stage.body.kind;
  for (const Chart& chart : stage.body.charts)
    scene.chart_sizes.emplace_back(chart.width, chart.height);
  scene.grid_columns = (stage.body.charts[0].columns - 1) * options.refine + 1;
  scene.grid_rows = (stage.body.charts[0].rows - 1) * options.refine + 1;
  return scene;
}

Preset ParsePreset(std::string_view name) {
  const auto* found = std::ranges::find(kPresets, name, &PresetRow::name);
  if (found != kPresets.end()) return found->preset;
  throw Error(ErrorCode::kInvalidArgument, "preset_unknown",
              "unknown preset '" + std::string(name) +
                  "'; known: pairs, objects, sequence, rotation, scale, planar, street");
}

std::string ToString(Preset preset) { return std::string(RowOf(preset).name); }

int DefaultViews(Preset preset) { return RowOf(preset).views; }

void Validate(const SceneOptions& options) {
  Require(options.views == 0 || (options.views >= 2 && options.views <= 10000), "views",
          "0 (the preset's own) or 2..10000");
  Require(options.width >= 32 && options.width <= 4096, "width", "32..4096 pixels");
  Require(options.height >= 32 && options.height <= 4096, "height", "32..4096 pixels");
  Require(options.channels == 1 || options.channels == 3, "channels", "1 or 3");
  Require(options.strength > 0.0F && options.strength <= 1.0F, "strength", "in (0, 1]");
  Require(options.occluders >= 0.0F && options.occluders <= 1.0F, "occluders",
          "a probability in [0, 1]");
  Require(options.turn_deg >= 0.0F && options.turn_deg <= 3600.0F, "turn_deg", "0..3600 degrees");
  Require(options.least_scale >= 0.1F && options.least_scale <= 1.0F, "least_scale", "0.1..1");
  Require(options.printed >= 0.0F && options.printed <= 1.0F, "printed", "a probability in [0, 1]");
  Require(options.least_width > 0.0F && options.least_width <= options.most_width &&
              options.most_width <= 1.0F,
          "least_width", "in (0, most_width], at most 1");
  Require(options.cells >= 8 && options.cells <= 128, "cells", "8..128");
  Require(options.refine >= 1 && options.refine <= 8, "refine", "1..8");
}

}  // namespace pliant::simulation
