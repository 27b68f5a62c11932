// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is interrupted: one operation on a small database, each.
#pragma once

#include <filesystem>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "index/engine/engine.h"
#include "tests/chaos/faults/simulated_disk.h"

namespace pliant::chaos {

// The operation calls this whenever something is acknowledged to its user: it must not be lost.
using Acknowledge = std::function<void()>;

struct Scenario {
  std::string name;
  // Empties the folder and fills it: what is there before the operation.
  std::function<void(const std::filesystem::path& folder)> prepare;
  // The operation, on an engine that was opened with `options`. Called again after a fault, it
  // finishes what was left undone.
  std::function<void(Engine& engine, const std::filesystem::path& folder, const Acknowledge& done)>
      act;
  // Where originals go; absent: as the database remembers.
  bool into_files = false;
  // Opening the database is the operation.
  bool opens = false;
  bool describes = false;  // new images
  std::string also;        // a second database that it makes, "" = none
  std::string leaves;      // a folder where files may be left that nobody needs, "" = none
};

// All that the campaign goes through.
const std::vector<Scenario>& Scenarios();
const Scenario& ScenarioOf(const std::string& name);
EngineOptions OptionsOf(const Scenario& scenario, const std::filesystem::path& folder);

inline std::ostream& operator<<(std::ostream& out, const Scenario& scenario) {
  return out << scenario.name;
}

}  // namespace pliant::chaos
