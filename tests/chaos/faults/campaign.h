// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Interrupts a scenario at one point, and judges what is left.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/chaos/faults/contents.h"
#include "tests/chaos/faults/scenarios.h"
#include "tests/chaos/faults/simulated_disk.h"

namespace pliant::chaos {

struct Verdict {
  bool struck = false;  // false: the scenario ended before the fault's turn came
  std::string victim;   // the call that it struck
  std::vector<std::string> problems;
};

// After each fault the rules are: all that was acknowledged is there; what was interrupted is done
// or not done, never in part; the database's check finds nothing; the operation can be done again;
// and in the end no file is left that a run without a fault does not leave.
class Campaign {
 public:
  // Runs the scenario once without a fault, to know what is right.
  explicit Campaign(const Scenario& scenario);

  // The disks of this campaign forget to flush (SimulatedDisk::IgnoreFlushes).
  void IgnoreFlushes(bool of_files, bool of_directories);

  // Power goes at the `at`-th change of the disk; the engine is thrown away and opened anew on what
  // is left.
  Verdict LosePower(std::uint64_t at, Keep keep, std::uint64_t seed);
  // Calls fail or are cut short (Fault). The engine lives on: it must show the right state, do the
  // operation when asked again, and survive power loss after that.
  Verdict Fail(const Fault& fault);

 private:
  struct Run {
    std::unique_ptr<Engine> engine;  // nullptr: it could not be opened
    std::size_t acknowledged = 0;
    bool threw = false;
  };

  const std::filesystem::path& folder() const;
  void Begin(Run* run, Verdict* verdict) const;  // opens and acts
  Contents Look(Engine& engine) const;
  void Judge(Engine& engine, std::size_t acknowledged, Verdict* verdict) const;
  void FinishAndJudge(Engine& engine, Verdict* verdict) const;
  void GoOnLiving(Run* run, Verdict* verdict) const;
  void Recover(std::size_t acknowledged, Verdict* verdict) const;
  void JudgeFiles(Verdict* verdict) const;

  const Scenario& scenario_;
  Image base_;
  std::vector<Contents> states_;  // before, and after each acknowledgement
  std::set<std::string> names_;   // of files and folders in the end
  bool ignore_file_flushes_ = false;
  bool ignore_folder_flushes_ = false;
};

}  // namespace pliant::chaos
