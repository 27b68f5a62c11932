// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/evaluation/pair_order.h"

#include <utility>

#include "descriptor/simulation/random.h"

namespace pliant::evaluation {
namespace {

template <typename Value>
void Shuffle(std::vector<Value>& values, simulation::Random& random) {
  for (std::size_t left = values.size(); left > 1; --left)
    std::swap(values[left - 1],
              values[static_cast<std::size_t>(random.Integer(0, static_cast<int>(left) - 1))]);
}

}  // namespace

std::vector<PairCandidate> AllPairs(const Dataset& dataset) {
  std::vector<PairCandidate> candidates;
  for (std::size_t s = 0; s < dataset.scenes.size(); ++s) {
    for (const ViewPair& pair : dataset.scenes[s].pairs) candidates.push_back({s, pair});
  }
  return candidates;
}

std::vector<PairCandidate> ShufflePairs(const Dataset& dataset, std::uint64_t seed) {
  simulation::Random random(seed);
  std::vector<std::vector<PairCandidate>> scenes(dataset.scenes.size());
  for (const PairCandidate& candidate : AllPairs(dataset))
    scenes[candidate.scene].push_back(candidate);
  for (std::vector<PairCandidate>& scene : scenes) {
    Shuffle(scene, random);
    for (PairCandidate& candidate : scene) {
      const bool symmetric = !candidate.pair.sweep && candidate.pair.group.empty();
      if (symmetric && random.Chance(0.5F)) std::swap(candidate.pair.first, candidate.pair.second);
    }
  }
  Shuffle(scenes, random);
  std::vector<PairCandidate> order;
  for (std::size_t round = 0;; ++round) {
    const std::size_t before = order.size();
    for (const std::vector<PairCandidate>& scene : scenes) {
      if (round < scene.size()) order.push_back(scene[round]);
    }
    if (order.size() == before) return order;
  }
}

}  // namespace pliant::evaluation
