// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A small seeded generator (PCG32, O'Neill 2014) with its own distributions, so that a scene is
// bit-identical for every standard library, number of threads and order of scenes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <Eigen/Core>

namespace pliant::simulation {

inline constexpr float kPi = std::numbers::pi_v<float>;

class Random {
 public:
  // Streams with different numbers are independent of one another.
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0)
      : increment_((Mix(stream) << 1U) | 1U) {
    Next();
    state_ += Mix(seed);
    Next();
  }

  std::uint32_t Next() {
    const std::uint64_t old = state_;
    state_ = old * 6364136223846793005ULL + increment_;
    const auto xored = static_cast<std::uint32_t>(((old >> 18U) ^ old) >> 27U);
    const auto turn = static_cast<std::uint32_t>(old >> 59U);
    return (xored >> turn) | (xored << ((32U - turn) & 31U));
  }

  // In [0, 1).
  float Uniform() { return static_cast<float>(Next() >> 8U) * 0x1p-24F; }
  float Uniform(float low, float high) { return low + (high - low) * Uniform(); }
  float LogUniform(float low, float high) {
    return std::exp(Uniform(std::log(low), std::log(high)));
  }
  // In [low, high], both included.
  int Integer(int low, int high) {
    const auto span = static_cast<std::uint64_t>(high - low) + 1;
    return low + static_cast<int>((span * Next()) >> 32U);
  }
  bool Chance(float probability) { return Uniform() < probability; }
  float Angle() { return Uniform(0.0F, 2.0F * kPi); }

  // Standard normal (Box-Muller).
  float Normal() {
    const float radius = std::sqrt(-2.0F * std::log(1.0F - Uniform()));
    return radius * std::cos(Angle());
  }
  Eigen::Vector3f Normal3() {
    const float x = Normal();
    const float y = Normal();
    return {x, y, Normal()};
  }
  // Uniform on the unit sphere.
  Eigen::Vector3f Direction() {
    const float z = Uniform(-1.0F, 1.0F);
    const float turn = Angle();
    const float radius = std::sqrt(std::max(0.0F, 1.0F - z * z));
    return {radius * std::cos(turn), radius * std::sin(turn), z};
  }
  // An independent generator for a sub-task: its draws do not affect those that follow here.
  Random Fork() {
    const std::uint64_t seed = (static_cast<std::uint64_t>(Next()) << 32U) | Next();
    return Random(seed, Next());
  }

 private:
  // SplitMix64's finaliser (Steele et al. 2014): neighbouring seeds give unrelated states.
  static std::uint64_t Mix(std::uint64_t value) {
    value += 0x9E3779B97F4A7C15ULL;
    value = (value ^ (value >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    value = (value ^ (value >> 27U)) * 0x94D049BB133111EBULL;
    return value ^ (value >> 31U);
  }

  std::uint64_t state_ = 0;
  std::uint64_t increment_;
};

}  // namespace pliant::simulation
