// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The state and the two steps of FasterPAM (Schubert and Rousseeuw 2021, Algorithm 3). Internal
// to vocab/; see vocab/k_medoids.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "vocab/distance_rows.h"

namespace pliant {

// The effect on the loss of exchanging a medoid for a candidate.
struct Swap {
  std::uint32_t position = 0;  // of the medoid to be removed
  double change = 0;           // of the loss; below 0 is better
};

class FasterPam {
 public:
  // `medoids`: k >= 2 distinct rows.
  FasterPam(const DistanceRows& rows, std::vector<std::uint32_t> medoids);

  const std::vector<std::uint32_t>& medoids() const { return medoids_; }
  bool is_medoid(std::size_t row) const { return is_medoid_[row] != 0; }
  double loss() const { return loss_; }

  // The best medoid to exchange for the candidate whose distances to all samples are `distances`:
  // O(N + k), since the cost of removing each medoid is maintained. `scratch` belongs to the
  // caller. Thread-safe.
  Swap Evaluate(const float* distances, std::vector<double>* scratch) const;

  // Exchanges the medoid at `position` for `candidate`.
  void Apply(std::uint32_t position, std::uint32_t candidate, const float* distances);

 private:
  // Sets nearest and second nearest of the listed samples from the distances to all medoids.
  void Search(const std::vector<std::uint32_t>& samples);
  void UpdateSums();

  const DistanceRows& rows_;
  std::vector<std::uint32_t> medoids_;
  std::vector<char> is_medoid_;
  std::vector<std::uint32_t> nearest_;   // N: position of the nearest medoid
  std::vector<std::uint32_t> second_;    // N: position of the second nearest
  std::vector<float> nearest_distance_;  // N
  std::vector<float> second_distance_;   // N
  std::vector<double> removal_loss_;     // k: increase of the loss when each medoid is removed
  double loss_ = 0;
  std::vector<std::uint32_t> orphans_;  // scratch of Apply
  std::vector<float> gathered_;         // scratch of Search
};

}  // namespace pliant
