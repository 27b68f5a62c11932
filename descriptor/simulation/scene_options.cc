// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Names, defaults and limits of what can be asked of a scene.
#include <array>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/simulation/scene.h"

namespace pliant::simulation {
namespace {

constexpr std::array<std::pair<Preset, std::string_view>, 7> kPresets{{
    {Preset::kPairs, "pairs"},
    {Preset::kObjects, "objects"},
    {Preset::kSequence, "sequence"},
    {Preset::kRotation, "rotation"},
    {Preset::kScale, "scale"},
    {Preset::kPlanar, "planar"},
    {Preset::kStreet, "street"},
}};

void Require(bool condition, const char* field, const char* range) {
  if (condition) return;
  throw Error(ErrorCode::kInvalidArgument, "option_out_of_range",
              std::string("simulation option ") + field + " must be " + range);
}

}  // namespace

Preset ParsePreset(std::string_view name) {
  for (const auto& [preset, word] : kPresets) {
    if (word == name) return preset;
  }
  throw Error(ErrorCode::kInvalidArgument, "preset_unknown",
              "unknown preset '" + std::string(name) +
                  "'; known: pairs, objects, sequence, rotation, scale, planar, street");
}

std::string ToString(Preset preset) {
  for (const auto& [value, word] : kPresets) {
    if (value == preset) return std::string(word);
  }
  return "pairs";
}

int DefaultViews(Preset preset) {
  switch (preset) {
    case Preset::kObjects:
      return 11;
    case Preset::kSequence:
      return 61;
    case Preset::kRotation:
      return 20;  // 0, 10, ... 180 degrees
    case Preset::kScale:
      return 10;
    case Preset::kPairs:
    case Preset::kPlanar:
    case Preset::kStreet:
      break;
  }
  return 5;
}

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
  Require(options.cells >= 8 && options.cells <= 128, "cells", "8..128");
  Require(options.refine >= 1 && options.refine <= 8, "refine", "1..8");
}

}  // namespace pliant::simulation
