// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "tests/chaos/faults/campaign.h"

#include <chrono>
#include <stdexcept>
#include <utility>

#include "descriptor/base/error.h"
#include "tests/unit/index_test_images.h"

namespace pliant::chaos {
namespace {

namespace fs = std::filesystem;

constexpr int kProbes = 4;

const Probes& TheProbes() {
  static const Probes probes(kProbes);
  return probes;
}

std::set<std::string> NamesOf(const Image& image) {
  std::set<std::string> names = image.folders;
  for (const auto& [name, bytes] : image.files) names.insert(name);
  return names;
}

// Files in the making count as abandoned once they are old.
void Age(const fs::path& folder) {
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().filename().string().find(".new-") == std::string::npos) continue;
    fs::last_write_time(entry.path(), fs::file_time_type::clock::now() - std::chrono::minutes(5));
  }
}

// What a caller may see: Error.
template <typename Work>
bool Threw(const std::string& doing, Verdict* verdict, Work&& work) {
  try {
    work();
    return false;
  } catch (const Error&) {
  } catch (const std::exception& other) {
    verdict->problems.push_back(doing + " threw what is no Error: " + other.what());
  }
  return true;
}

// Nothing may be thrown here.
template <typename Work>
void Require(const std::string& doing, Verdict* verdict, Work&& work) {
  try {
    work();
  } catch (const std::exception& error) {
    verdict->problems.push_back(doing + ": " + error.what());
  }
}

}  // namespace

Campaign::Campaign(const Scenario& scenario) : scenario_(scenario) {
  scenario_.prepare(folder());
  base_ = ReadImage(folder());
  auto engine = std::make_unique<Engine>(OptionsOf(scenario_, folder()));
  states_.push_back(Look(*engine));
  scenario_.act(*engine, folder(), [&] { states_.push_back(Look(*engine)); });
  engine.reset();
  names_ = NamesOf(ReadImage(folder()));
}

// One for all, because paths are written into databases.
const fs::path& Campaign::folder() const {
  static const testing::TemporaryFolder folder;
  static const fs::path path = fs::canonical(folder.path());
  return path;
}

void Campaign::IgnoreFlushes(bool of_files, bool of_directories) {
  ignore_file_flushes_ = of_files;
  ignore_folder_flushes_ = of_directories;
}

Contents Campaign::Look(Engine& engine) const {
  Contents contents;
  for (const std::string& problem : engine.Check()) contents["check: " + problem] = "found";
  contents.merge(TheProbes().Look(engine, folder() / "a.db"));
  if (!scenario_.also.empty() && fs::exists(folder() / scenario_.also)) {
    EngineOptions options = OptionsFor(folder());
    options.database = folder() / scenario_.also;
    Engine also(options);
    for (auto& [name, value] : TheProbes().Look(also, options.database)) {
      contents[scenario_.also + ": " + name] = value;
    }
    for (const std::string& problem : also.Check()) contents[scenario_.also] += problem + "; ";
  }
  return contents;
}

void Campaign::Begin(Run* run, Verdict* verdict) const {
  run->threw = Threw("opening", verdict, [&] {
    run->engine = std::make_unique<Engine>(OptionsOf(scenario_, folder()));
  });
  if (!run->engine) return;
  run->threw = Threw(scenario_.name, verdict,
                     [&] { scenario_.act(*run->engine, folder(), [&] { ++run->acknowledged; }); });
}

void Campaign::Judge(Engine& engine, std::size_t acknowledged, Verdict* verdict) const {
  Require("looking at what is left", verdict, [&] {
    const Contents found = Look(engine);
    const Contents& done = states_.at(acknowledged);
    const Contents& next = states_.at(std::min(acknowledged + 1, states_.size() - 1));
    if (found != done && found != next) {
      verdict->problems.push_back(std::to_string(acknowledged) +
                                  " acknowledged, but:" + Difference(done, found) +
                                  (next == done ? "" : "\n or:" + Difference(next, found)));
    }
  });
}

void Campaign::FinishAndJudge(Engine& engine, Verdict* verdict) const {
  Require("doing it again", verdict, [&] { scenario_.act(engine, folder(), [] {}); });
  Judge(engine, states_.size() - 1, verdict);
}

void Campaign::Recover(std::size_t acknowledged, Verdict* verdict) const {
  Age(folder());
  Require("opening what is left", verdict, [&] {
    Engine engine(OptionsOf(scenario_, folder()));
    Judge(engine, acknowledged, verdict);
    FinishAndJudge(engine, verdict);
    engine.SweepOriginals();
  });
  JudgeFiles(verdict);
}

void Campaign::JudgeFiles(Verdict* verdict) const {
  const std::set<std::string> found = NamesOf(ReadImage(folder()));
  for (const std::string& name : found) {
    const bool left = !scenario_.leaves.empty() && name.starts_with(scenario_.leaves + "/");
    if (!names_.contains(name) && !left) verdict->problems.push_back("a stray file: " + name);
  }
  for (const std::string& name : names_) {
    if (!found.contains(name)) verdict->problems.push_back("a missing file: " + name);
  }
}

Verdict Campaign::LosePower(std::uint64_t at, Keep keep, std::uint64_t seed) {
  Verdict verdict;
  WriteImage(base_, folder());
  Run run;
  Image left;
  {
    SimulatedDisk disk(folder());
    disk.IgnoreFlushes(ignore_file_flushes_, ignore_folder_flushes_);
    disk.Arm({Fault::Kind::kPowerLoss, kChanges, at, false, 0});
    Begin(&run, &verdict);
    run.engine.reset();
    verdict.struck = disk.struck();
    verdict.victim = disk.victim();
    left = disk.AfterPowerLoss(keep, seed);
  }
  WriteImage(left, folder());
  Recover(run.acknowledged, &verdict);
  return verdict;
}

void Campaign::GoOnLiving(Run* run, Verdict* verdict) const {
  if (run->engine) Judge(*run->engine, run->acknowledged, verdict);
  if (!run->engine) {
    Require("opening again", verdict,
            [&] { run->engine = std::make_unique<Engine>(OptionsOf(scenario_, folder())); });
  }
  if (run->engine) FinishAndJudge(*run->engine, verdict);
  run->acknowledged = states_.size() - 1;
}

Verdict Campaign::Fail(const Fault& fault) {
  Verdict verdict;
  WriteImage(base_, folder());
  Run run;
  Image left;
  {
    SimulatedDisk disk(folder());
    disk.Arm(fault);
    Begin(&run, &verdict);
    if (disk.struck()) {
      verdict.struck = true;
      verdict.victim = disk.victim();
      disk.Disarm();
      if (fault.kind == Fault::Kind::kShortWrite && run.threw) {
        verdict.problems.emplace_back("a short write was not continued");
      }
      GoOnLiving(&run, &verdict);
    }
    run.engine.reset();  // or the fault strikes while it closes
    if (disk.struck()) {
      verdict.struck = true;
      verdict.victim = disk.victim();
    }
    disk.Disarm();
    left = disk.AfterPowerLoss(Keep::kNothing, 0);
  }
  WriteImage(left, folder());
  Recover(run.acknowledged, &verdict);
  return verdict;
}

}  // namespace pliant::chaos
