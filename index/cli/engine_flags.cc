// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/engine_flags.h"

#include "descriptor/base/strings.h"
#include "index/cli/output.h"
#include "index/usage/usage.h"

namespace pliant::cli {

void AddDatabaseFlag(CLI::App& app, EngineOptions& engine) {
  engine.warn = [](std::string_view text) { Message(text); };
  app.add_option("--db", engine.database,
                 "the database: a file, or the URL of a PostgreSQL database")
      ->required()
      ->type_name("FILE");
}

Engine OpenExisting(EngineOptions options, bool read_only, bool with_index) {
  options.create = false;
  options.load_descriptor = false;
  options.load_index = with_index;
  options.read_only = read_only;
  return Engine(options);
}

void AddCollectionFlag(CLI::App& app, std::string& collection) {
  app.add_option("--collection", collection, "the collection in the database")
      ->default_val(kDefaultCollection)
      ->type_name("NAME");
}

CLI::Option* AddOriginalsFlag(CLI::App& app, EngineOptions& engine, const std::string& help) {
  const auto read = [&engine](const std::string& text) {
    engine.originals_dir = ParseOriginalsDir(text);
  };
  return app.add_option_function<std::string>("--originals-dir", read, help)->type_name("DIR");
}

void AddJsonFlag(CLI::App& app, bool& json) {
  app.add_flag("--json", json, "print one JSON document");
}

void AddJobsFlag(CLI::App& app, int& jobs, const std::string& what) {
  app.add_option("--jobs,-j", jobs, what + "; 0 = one per core")->check(Between(0, 1024));
}

void AddModelFlag(CLI::App& app, std::filesystem::path& model) {
  app.add_option(
         "--model", model,
         "weight file for deal and its variants, or its folder (default: the installed one)")
      ->type_name("FILE");
}

void AddRankFlag(CLI::App& app, RankMethod& rank, const std::string& help) {
  AddChoice<RankMethod>(
      app, "--rank", rank, help,
      {{"neighbours", RankMethod::kNeighbours}, {"histogram", RankMethod::kHistogram}});
}

void AddCsvFlag(CLI::App& app, std::filesystem::path& csv, const std::string& help) {
  app.add_option("--csv", csv, help + "; - = standard output")->type_name("FILE");
}

void AddFilterFlag(CLI::App& app, std::string& filter, const std::string& help) {
  app.add_option("--filter", filter, help)->option_text("JSON");
}

void AddSeedFlag(CLI::App& app, std::uint64_t& seed, const std::string& help) {
  app.add_option("--seed", seed, help)->check(AtLeast(0));
}

void AddExtractionFlags(CLI::App& app, EngineOptions& engine, bool of_database) {
  const EngineOptions defaults;
  const auto with_default = [&](const std::string& help, const std::string& value) {
    return help + " (default: " +
           (of_database ? "the database's, or " + value + " for a new one" : value) + ")";
  };
  app.add_option(
         "--descriptor", engine.descriptor,
         with_default("the descriptor: " + Join(DescriptorNames(), ", "), kDefaultDescriptor))
      ->check(OneOf(DescriptorNames()))
      ->type_name("NAME");
  AddModelFlag(app, engine.descriptor_options.model_path);
  const auto keypoints = [&engine](int value) {
    engine.max_keypoints = value;
    engine.extraction.keypoints.max_keypoints = value;
  };
  app.add_option_function<int>(
         "--max-keypoints", keypoints,
         with_default(of_database
                          ? "keypoints per indexed image, strongest first; a query has twice as "
                            "many"
                          : "keypoints per image, strongest first",
                      std::to_string(defaults.extraction.keypoints.max_keypoints)))
      ->check(Between(1, 4096));
  const auto side = [&engine](int value) {
    engine.max_side_px = value;
    engine.extraction.decode.max_side_px = value;
  };
  app.add_option_function<int>(
         "--max-side", side,
         with_default("scale larger images down to this longer side in pixels",
                      std::to_string(defaults.extraction.decode.max_side_px)))
      ->check(Between(16, 65536));
}

std::string DescriptorName(const EngineOptions& engine) {
  return engine.descriptor.empty() ? kDefaultDescriptor : engine.descriptor;
}

std::shared_ptr<const Descriptor> NamedDescriptor(const EngineOptions& engine) {
  return MakeDescriptor(DescriptorName(engine), engine.descriptor_options);
}

void AddDescriptorListFlags(CLI::App& app, std::vector<std::string>& names,
                            DescriptorOptions& descriptor, ExtractionOptions& extraction) {
  app.add_option("--descriptor,--descriptors", names,
                 "the descriptors, one or more of " + Join(DescriptorNames(), ", "))
      ->delimiter(',')
      ->check(OneOf(DescriptorNames()))
      ->allow_extra_args(false)
      ->type_name("NAME,...");
  AddModelFlag(app, descriptor.model_path);
  app.add_option("--max-keypoints", extraction.keypoints.max_keypoints,
                 "keypoints per image, strongest first")
      ->check(Between(1, 4096));
  app.add_option("--max-side", extraction.decode.max_side_px,
                 "scale larger images down to this longer side in pixels; 0 = never")
      ->check(AtLeast(0));
}

void AddFeaturesFlag(CLI::App& app, std::vector<std::string>& features) {
  app.add_option("--features", features,
                 "another row, of features in FOLDER/IMAGE.npz for each DIR/IMAGE; can be repeated")
      ->allow_extra_args(false)
      ->type_name("NAME=FOLDER");
}

void AddRatioFlag(CLI::App& app, const std::string& name, float& ratio) {
  app.add_option(
         name, ratio,
         "ratio test: largest ratio of the nearest to the second nearest distance; 1 = none")
      ->check(AboveZero(1));
}

void AddTrackingFlags(CLI::App& app, int& every, LocateOptions& locate) {
  VerificationOptions& verification = locate.verification;
  app.add_option("--every", every, "use every N-th frame only")->check(Between(1, 1'000'000));
  app.add_option("--iterations", verification.ransac.iterations, "RANSAC samples per frame")
      ->check(Between(1, 1'000'000));
  AddRatioFlag(app, "--max-ratio", verification.max_ratio);
  app.add_option("--tolerance", verification.tolerance,
                 "largest distance of a match from the warp, relative to the frame's longer side")
      ->check(AboveZero(1));
  app.add_option("--regularization", verification.ransac.regularization,
                 "stiffness of the thin-plate spline; 0 = none")
      ->check(AtLeast(0));
  app.add_option("--min-inliers", locate.min_inliers,
                 "with fewer inliers the object counts as lost")
      ->check(AtLeast(4));
}

}  // namespace pliant::cli
