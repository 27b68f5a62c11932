// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant simulate --textures DIR --out DIR
#include <memory>

#include "descriptor/simulation/simulate.h"
#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/interrupt.h"
#include "index/cli/output.h"
#include "index/cli/progress.h"

namespace pliant::cli {
namespace {

struct Options {
  SimulateOptions simulate;
  bool json = false;
};

void PrintReport(const Options& options, const SimulateReport& report) {
  const double rate =
      report.seconds > 0.0 ? static_cast<double>(report.images) / report.seconds : 0.0;
  Json skipped = Json::array();
  for (const auto& [file, reason] : report.skipped) {
    Message("skipped {}: {}", file, reason);
    skipped.push_back({{"file", file}, {"reason", reason}});
  }
  Report(options.json,
         {{"scenes", report.scenes},
          {"unchanged", report.unchanged},
          {"images", report.images},
          {"textures", report.textures},
          {"skipped", std::move(skipped)},
          {"mean_stretch_p95", report.mean_stretch},
          {"worst_stretch_p95", report.worst_stretch},
          {"images_per_second", rate},
          {"seconds", report.seconds}},
         "made {} scenes ({} images) from {} textures in {:.1f} s, {:.1f} images/s; {} scenes "
         "existed already",
         report.scenes, report.images, report.textures, report.seconds, rate, report.unchanged);
  if (!options.json && report.images > 0) {
    Print("residual stretch of the cloth (95th percentile): {:.2f} % on average, {:.2f} % at worst",
          100.0 * report.mean_stretch, 100.0 * report.worst_stretch);
  }
}

ExitStatus Run(Options& options) {
  const Interrupt interrupt;
  Progress progress("scenes");
  options.simulate.progress = progress.CounterUntil(interrupt);
  const SimulateReport report = Simulate(options.simulate);
  PrintReport(options, report);
  return report.skipped.empty() ? ExitStatus::kDone : ExitStatus::kSomeSkipped;
}

}  // namespace

void AddSimulateCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  SimulateOptions& simulate = options->simulate;
  CLI::App* app = program.add_subcommand(
      "simulate", "Render images of deforming objects with exact correspondences");
  app->add_option("--textures", simulate.textures,
                  "folder of images, safetensors pack, or `procedural` for generated textures")
      ->required()
      ->type_name("DIR");
  app->add_option("--out,-o", simulate.out, "folder for the scenes")->required()->type_name("DIR");
  const auto choose = [app](const char* name, std::string& value, const std::string& help,
                            std::vector<std::string> words) {
    app->add_option(name, value, help)->check(OneOf(std::move(words)))->type_name("NAME");
  };
  choose("--preset", simulate.preset, "pairs, objects, sequence, rotation, scale, planar or street",
         {"pairs", "objects", "sequence", "rotation", "scale", "planar", "street"});
  choose("--format", simulate.format,
         "tensors (for training) or folders; auto: tensors for pairs and street, else folders",
         {"auto", "tensors", "folders"});
  app->add_option("--scenes", simulate.scenes, "number of scenes or objects")->check(AtLeast(1));
  app->add_option("--first", simulate.first, "number of the first scene")->check(AtLeast(0));
  app->add_option("--distractors", simulate.distractors,
                  "preset objects: further objects without a reference")
      ->check(AtLeast(0));
  app->add_option("--views", simulate.views,
                  "images per scene, including the reference, 2 or more; 0 = the default of the "
                  "preset")
      ->check(Between(0, 10'000));
  app->add_option("--width", simulate.width, "width of each image, in pixels")
      ->check(Between(32, 4096));
  app->add_option("--height", simulate.height, "height of each image, in pixels")
      ->check(Between(32, 4096));
  app->add_flag("--colour", simulate.colour, "render in colour instead of grey");
  app->add_option("--strength", simulate.strength,
                  "strength of deformation, light and noise, above 0, at most 1")
      ->check(AboveZero(1));
  app->add_option("--occluders", simulate.occluders, "probability that a part of a view is covered")
      ->check(Within(0, 1));
  app->add_option("--turn", simulate.turn_deg,
                  "preset sequence: maximum rotation of the camera about its axis, in degrees")
      ->check(Within(0, 3600));
  app->add_option("--least-scale", simulate.least_scale,
                  "preset sequence: smallest scale of the object at the end, 0.1 to 1")
      ->check(Within(0.1, 1));
  AddSeedFlag(*app, simulate.seed, "same seed, same scenes");
  AddJobsFlag(*app, simulate.jobs, "threads, one scene each");
  AddJsonFlag(*app, options->json);
  app->footer(
      "Example:  pliant simulate --textures procedural --out scenes --preset objects --scenes 3");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
