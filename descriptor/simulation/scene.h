// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// One scene: several views of a textured object, each with its own deformation, light and camera.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "descriptor/simulation/body.h"
#include "descriptor/simulation/motion.h"
#include "descriptor/simulation/photo.h"
#include "descriptor/simulation/renderer.h"
#include "descriptor/simulation/texture.h"

namespace pliant::simulation {

enum class Preset {
  kPairs,     // view 0 flat and frontal, the others strongly deformed: training, matching
  kObjects,   // the same, meant as one object of a retrieval set
  kSequence,  // view 0 the template, then one deformation over time: tracking
  kRotation,  // view 0, then one deformed pose rotated in the image plane, 0..180 degrees
  kScale,     // view 0, then one deformed pose scaled down to a quarter
  kPlanar,    // rigid flat sheets only: all views are homographies of one another
  kStreet,    // view 0 as in a catalogue, the others photographs in which it is small
};
// Throws Error kInvalidArgument "preset_unknown".
Preset ParsePreset(std::string_view name);
std::string ToString(Preset preset);
int DefaultViews(Preset preset);

struct SceneOptions {
  Preset preset = Preset::kPairs;
  int views = 0;    // with view 0; 0 = the preset's default
  int width = 640;  // of each view, pixels
  int height = 480;
  int channels = 1;         // 1 grey, 3 colour
  float strength = 1.0F;    // of deformation, light and noise, (0, 1]
  float occluders = 0.25F;  // probability that a view has some
  // Sequences: how far the camera turns about its axis at most, and the least scale it ends at.
  float turn_deg = 60.0F;
  float least_scale = 0.5F;
  // Preset street: probability that the scene shows a drawing on cloth, not the texture itself; and
  // how wide the print is, in widths of the view, before the view is enlarged (log-uniform).
  float printed = 0.7F;
  float least_width = 55.0F / 480.0F;
  float most_width = 220.0F / 480.0F;
  int cells = 34;  // simulated cells along the longer side
  int refine = 3;  // drawn cells per simulated cell and axis
};
// Throws Error kInvalidArgument "option_out_of_range" naming the field.
void Validate(const SceneOptions& options);

// How a camera was placed: what the sweeps change.
struct Framing {
  float roll_deg = 0.0F;  // turn in the image plane
  float tilt_deg = 0.0F;  // angle between the body's mean normal and the line of sight
  float tilt_direction_deg = 0.0F;
  float scale = 1.0F;     // 1: the flat object just fills the image
  float distance = 2.5F;  // of the camera, in lengths of the object's longer side
  float shift_x = 0.0F;   // of the object's centre from the image's, in image widths / heights
  float shift_y = 0.0F;
};

struct View {
  Image image;
  std::vector<std::uint8_t> chart;  // height x width; kNoChart = not the object's front
  std::vector<std::uint16_t> uv;    // height x width x 2; 65535 = 1
  // charts x grid_rows x grid_columns: where each vertex of the drawn grid falls, in pixels,
  // visible or not. NaN: no cloth there, or behind the camera.
  std::vector<Eigen::Array2f> grid;
  std::string motion;
  std::string backdrop;  // name of the background's texture; empty: plain
  float stretch_p95 = 0.0F;
  Framing framing;
  Camera camera;
  Lighting lighting;
  PhotoOptions photo;
  std::optional<DevelopOptions> develop;  // preset street
};

struct Scene {
  Preset preset = Preset::kPairs;
  std::uint64_t seed = 0;
  std::uint64_t index = 0;
  BodyKind kind = BodyKind::kSheet;
  std::vector<std::string> textures;        // per chart
  std::vector<Eigen::Array2f> chart_sizes;  // per chart: width, height
  int grid_columns = 0;
  int grid_rows = 0;
  std::vector<View> views;
};

// Makes scene `index` of the set with this `seed`. The result depends only on the arguments.
// Successive scenes show all textures in turn; backgrounds and backs are other textures.
// Throws Error kInvalidArgument (options; "textures_missing" for none).
Scene MakeScene(const TextureSource& textures, const SceneOptions& options, std::uint64_t seed,
                std::uint64_t index);

}  // namespace pliant::simulation
