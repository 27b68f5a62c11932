// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/simulate.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <mutex>
#include <sstream>
#include <system_error>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/base/replace_file.h"
#include "descriptor/base/stopwatch.h"
#include "descriptor/image/image.h"
#include "descriptor/simulation/procedural.h"
#include "descriptor/simulation/scene.h"
#include "descriptor/simulation/scene_file.h"
#include "descriptor/simulation/scene_folder.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;
using namespace simulation;

constexpr int kProceduralTextures = 96;
constexpr int kTextureSide = 768;

void Require(bool condition, const std::string& message) {
  if (!condition) throw Error(ErrorCode::kInvalidArgument, "option_out_of_range", message);
}

bool WritesTensors(const SimulateOptions& options, Preset preset) {
  Require(options.format == "auto" || options.format == "tensors" || options.format == "folders",
          "format must be auto, tensors or folders, not '" + options.format + "'");
  if (options.format == "auto") return preset == Preset::kPairs || preset == Preset::kStreet;
  return options.format == "tensors";
}

SceneOptions ToSceneOptions(const SimulateOptions& options) {
  SceneOptions scene;
  scene.preset = ParsePreset(options.preset);
  scene.views = options.views;
  scene.width = options.width;
  scene.height = options.height;
  scene.channels = options.colour || scene.preset == Preset::kObjects ? 3 : 1;
  scene.strength = static_cast<float>(options.strength);
  scene.occluders = static_cast<float>(options.occluders);
  scene.turn_deg = static_cast<float>(options.turn_deg);
  scene.least_scale = static_cast<float>(options.least_scale);
  Validate(scene);
  Require(options.scenes >= 1, "the number of scenes must be at least 1");
  Require(options.first >= 0, "the number of the first scene must be at least 0");
  Require(options.distractors >= 0, "the number of distractors must be at least 0");
  Require(options.distractors == 0 || scene.preset == Preset::kObjects,
          "distractors need the preset objects");
  Require(options.jobs >= 0, "the number of jobs must be at least 0 (0 = one per core)");
  Require(!options.textures.empty(), "textures is empty; name a folder, a pack, or procedural");
  Require(!options.out.empty(), "out is empty; name a folder");
  return scene;
}

Image DecodeTexture(std::span<const std::uint8_t> bytes) {
  DecodeOptions decode;
  decode.max_side_px = kTextureSide;
  decode.colour = true;
  return DecodeImage(bytes, decode).image;
}

TextureSource OpenTextures(const SimulateOptions& options, SimulateReport& report) {
  if (options.textures == "procedural")
    return ProceduralTextures(kProceduralTextures, options.seed);
  std::vector<SkippedFile> skipped;
  TextureSource source = LoadTextures(options.textures, DecodeTexture, options.jobs, skipped);
  for (const auto& [file, reason] : skipped) report.skipped.push_back({file, reason});
  return source;
}

// One run: which scenes, where they go, and what has been made so far.
class Run {
 public:
  Run(const SimulateOptions& options, const SceneOptions& scene, const TextureSource& textures,
      SimulateReport& report)
      : options_(options),
        scene_(scene),
        textures_(textures),
        report_(report),
        tensors_(WritesTensors(options, scene.preset)) {}

  void Make(std::int64_t i) {
    const std::int64_t number = options_.first + i;
    const bool distractor = i >= options_.scenes;
    const fs::path path = fs::path(options_.out) / Name(number, distractor);
    const bool exists = fs::exists(path);
    Scene scene;
    if (!exists) {
      scene = MakeScene(textures_, scene_, options_.seed, static_cast<std::uint64_t>(number));
      Write(path, scene, distractor);
    }
    Count(scene, exists);
  }
  void Finish() {
    if (report_.images > 0) report_.mean_stretch = stretch_ / static_cast<double>(report_.images);
  }

 private:
  std::string Name(std::int64_t number, bool distractor) const {
    const auto index = static_cast<std::uint64_t>(number);
    if (tensors_) return SceneFileName(index);
    if (scene_.preset != Preset::kObjects) return NumberedName("scene", index, 6);
    return NumberedName(distractor ? "distractor" : "object", index + 1, 4);
  }
  void Write(const fs::path& path, const Scene& scene, bool distractor) const {
    if (tensors_) {
      WriteSceneFile(path, scene);
    } else if (scene_.preset == Preset::kObjects) {
      WriteObjectFolder(path, scene, !distractor);
    } else {
      WriteSceneFolder(path, scene);
    }
  }
  void Count(const Scene& scene, bool exists) {
    const std::lock_guard lock(mutex_);
    ++(exists ? report_.unchanged : report_.scenes);
    report_.images += static_cast<std::int64_t>(scene.views.size());
    for (const View& view : scene.views) {
      stretch_ += static_cast<double>(view.stretch_p95);
      report_.worst_stretch =
          std::max(report_.worst_stretch, static_cast<double>(view.stretch_p95));
    }
    if (!options_.progress) return;
    if (!options_.progress(report_.scenes + report_.unchanged,
                           options_.scenes + options_.distractors)) {
      throw Error(ErrorCode::kCancelled, "simulation_stopped",
                  "stopped on request; all scenes in the folder are complete");
    }
  }

  const SimulateOptions& options_;
  const SceneOptions& scene_;
  const TextureSource& textures_;
  std::mutex mutex_;  // guards report_ and stretch_
  SimulateReport& report_;
  double stretch_ = 0.0;
  bool tensors_;
};

// All that the scenes of a set have in common.
std::string Settings(const SimulateOptions& options, const SceneOptions& scene,
                     std::size_t textures) {
  std::ostringstream text;
  text << "preset " << options.preset << "\nseed " << options.seed << "\ntextures " << textures
       << "\nviews " << scene.views << "\nwidth " << scene.width << "\nheight " << scene.height
       << "\nchannels " << scene.channels << "\nstrength " << scene.strength << "\noccluders "
       << scene.occluders << "\nturn " << scene.turn_deg << "\nleast-scale " << scene.least_scale
       << "\nformat " << (WritesTensors(options, scene.preset) ? "tensors" : "folders") << '\n';
  if (options.distractors > 0)
    text << "first distractor " << options.first + options.scenes << '\n';
  return text.str();
}

// The first line of `settings` that `others` does not have.
std::string FirstDifference(const std::string& settings, const std::string& others) {
  std::istringstream lines(settings);
  for (std::string line; std::getline(lines, line);) {
    if (('\n' + others).find('\n' + line + '\n') == std::string::npos) return line;
  }
  return "fewer lines";
}

// Creates the folder of a set, or continues a set of the same settings.
void OpenFolder(const std::string& folder, const std::string& settings) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  const fs::path file = fs::path(folder) / "settings.txt";
  if (!failed && fs::exists(file)) {
    std::ifstream in(file);
    const std::string stored{std::istreambuf_iterator<char>(in), {}};
    if (stored == settings) return;
    throw Error(ErrorCode::kConflict, "other_settings",
                "the folder " + folder + " has scenes of other settings (" +
                    FirstDifference(stored, settings) + ", not " +
                    FirstDifference(settings, stored) + "); name another folder");
  }
  const std::string_view parts[] = {settings};
  if (!failed) failed = ReplaceFile(file, parts);
  if (failed) {
    throw Error(ErrorCode::kNoSpace, "file_unwritable",
                "cannot write to the output folder " + folder + ": " + failed.message());
  }
}

}  // namespace

SimulateReport Simulate(const SimulateOptions& options) {
  const SceneOptions scene = ToSceneOptions(options);
  (void)WritesTensors(options, scene.preset);  // refuses an unknown format before anything is read
  SimulateReport report;
  const TextureSource textures = OpenTextures(options, report);
  report.textures = static_cast<std::int64_t>(textures.size());
  OpenFolder(options.out, Settings(options, scene, textures.size()));
  const Stopwatch watch;
  Run run(options, scene, textures, report);
  ParallelFor(static_cast<std::size_t>(options.scenes + options.distractors), options.jobs,
              [&run](std::size_t i) { run.Make(static_cast<std::int64_t>(i)); });
  run.Finish();
  report.seconds = watch.seconds();
  return report;
}

}  // namespace pliant
