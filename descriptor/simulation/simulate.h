// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Makes sets of simulated scenes on disk; called by `pliant simulate`.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace pliant {

struct SimulateOptions {
  // A folder of images of any type that Pliant reads (searched recursively), a safetensors pack,
  // or "procedural" for generated images.
  std::string textures;
  std::string out;               // folder, created if it does not exist
  std::string preset = "pairs";  // pairs, objects, sequence, rotation, scale, planar, street
  std::string format = "auto";   // tensors, folders; auto: tensors for pairs and street
  std::int64_t scenes = 100;
  std::int64_t first = 0;        // number of the first scene, to make a set in parts
  std::int64_t distractors = 0;  // preset objects: folders with views of further objects, no ref
  int views = 0;                 // per scene, including the reference; 0 = the preset's own
  int width = 640;               // of each view, pixels
  int height = 480;
  bool colour = false;       // always true for the preset objects
  double strength = 1.0;     // of deformation, light and noise, (0, 1]
  double occluders = 0.25;   // probability that a view is partly hidden
  double turn_deg = 60.0;    // preset sequence: largest turn of the camera about its axis
  double least_scale = 0.5;  // preset sequence: the object's final scale is this to 1
  std::uint64_t seed = 1;
  int jobs = 0;  // threads; 0 = one per core
  // Called after each scene (made, wanted), from any thread, never concurrently. Returning false
  // stops; scenes written so far are kept.
  std::function<bool(std::int64_t done, std::int64_t total)> progress;
};

struct SimulateReport {
  std::int64_t scenes = 0;     // made now
  std::int64_t unchanged = 0;  // existed already
  std::int64_t images = 0;     // made now
  std::int64_t textures = 0;   // usable
  double seconds = 0.0;
  // Residual stretch of the cloth (95th percentile over the edges of a view): the mean over all
  // views, and the worst view.
  double mean_stretch = 0.0;
  double worst_stretch = 0.0;
  struct Skipped {
    std::string file, reason;
  };
  std::vector<Skipped> skipped;  // textures that could not be used
};

// The same options give bit-identical files on one machine, independently of `jobs`. Scenes appear
// complete or not at all. Existing scenes are kept, so that an interrupted run can be resumed;
// settings.txt in the folder says how they were made. Throws Error: kInvalidArgument
// ("option_out_of_range", "preset_unknown", "textures_missing"), kNotFound "textures_not_found",
// kConflict "other_settings" for a folder with scenes of other settings, kNoSpace
// "file_unwritable", kCancelled "simulation_stopped".
SimulateReport Simulate(const SimulateOptions& options);

}  // namespace pliant
