// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What a database holds, as a user sees it: to be compared before and after a fault.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "index/engine/engine.h"

namespace pliant::chaos {

// A line for each collection, image (its record, the hashes of its bytes and of its features),
// vocabulary, key, job, and for the answer to each probe; by a name that says what it is. Numbers
// and times that depend on how often something was tried are left out.
using Contents = std::map<std::string, std::string>;

// Small images, each unlike the others: PNG files of `seed`.
const std::vector<std::uint8_t>& ImageBytes(std::uint64_t seed);

// How all engines of the campaign are opened, on the database "a.db" of the folder.
EngineOptions OptionsFor(const std::filesystem::path& folder);

// What is asked of every collection that has a vocabulary; described once.
class Probes {
 public:
  explicit Probes(int count);
  Contents Look(Engine& engine, const std::filesystem::path& database) const;

 private:
  void LookInto(Engine& engine, const std::string& collection, Contents* contents) const;

  std::vector<Features> features_;
};

// The lines that differ; empty = none.
std::string Difference(const Contents& expected, const Contents& found);

}  // namespace pliant::chaos
