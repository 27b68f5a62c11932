// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Verification: matching alone, the warp alone, and a query against 100 candidates. Inliers are
// printed beside the time.
#include <cmath>
#include <cstdint>
#include <random>

#include <benchmark/benchmark.h>

#include "descriptor/base/parallel.h"
#include "descriptor/match/matching.h"
#include "index/store/blob_codec.h"
#include "index/verify/verification.h"

namespace pliant {
namespace {

constexpr int kDim = 128;

// Keypoints and unit descriptors; the first `shared` are those of `of`, bent and changed a little.
Features MakeImage(std::size_t n, std::uint64_t seed, const Features* of, std::size_t shared,
                   bool binary) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<float> normal;
  Features f;
  f.width = 640;
  f.height = 480;
  f.model_id = "bench:1";
  f.descriptors = binary ? Descriptors::Binary(n, 32) : Descriptors::Float(n, kDim);
  for (std::size_t i = 0; i < n; ++i) {
    Keypoint k;
    k.x = static_cast<float>(generator() % 6400) / 10;
    k.y = static_cast<float>(generator() % 4800) / 10;
    k.size = 4 + static_cast<float>(generator() % 80) / 10;
    const bool is_shared = of != nullptr && i < shared;
    if (is_shared) {
      const Keypoint& o = of->keypoints[i];
      k.x = 0.7F * o.x + 15 * std::sin(o.y / 70) + 60;
      k.y = 0.7F * o.y + 12 * std::cos(o.x / 80) + 40;
      k.size = 0.7F * o.size;
    }
    f.keypoints.push_back(k);
    for (int p = 0; binary && p < 32; ++p) {
      const auto noise = generator() & generator() & generator();
      f.descriptors.bytes[i * 32 + p] = static_cast<std::uint8_t>(
          is_shared ? of->descriptors.bytes[i * 32 + p] ^ noise : generator());
    }
    for (int p = 0; !binary && p < kDim; ++p) {
      const float fresh = normal(generator) / std::sqrt(static_cast<float>(kDim));
      f.descriptors.floats[i * kDim + p] =
          is_shared ? of->descriptors.floats[i * kDim + p] + 0.4F * fresh : fresh;
    }
  }
  return f;
}

void MatchPair(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0));
  const bool binary = state.range(1) != 0;
  const auto query = MakeImage(n, 1, nullptr, 0, binary);
  const auto reference = MakeImage(n, 2, &query, n / 5, binary);
  const PackedDescriptors packed(query.descriptors);
  for (auto _ : state) {
    benchmark::DoNotOptimize(MatchDescriptors(packed, reference.descriptors));
  }
}
BENCHMARK(MatchPair)
    ->ArgNames({"descriptors", "binary"})
    ->ArgsProduct({{700, 1000, 2000}, {0, 1}})
    ->Unit(benchmark::kMillisecond);

void VerifyPair(benchmark::State& state) {
  const auto query = InStoredPrecision(MakeImage(1000, 1, nullptr, 0, false));
  const auto reference = InStoredPrecision(
      MakeImage(1000, 2, &query, static_cast<std::size_t>(state.range(0)), false));
  const Verifier verifier(query);
  VerificationResult result;
  for (auto _ : state) result = verifier.Verify(reference);
  state.counters["matches"] = result.matches;
  state.counters["inliers"] = static_cast<double>(result.inliers.size());
}
BENCHMARK(VerifyPair)->ArgName("shared")->Arg(0)->Arg(50)->Arg(300)->Unit(benchmark::kMillisecond);

// One candidate in ten shows the object.
void VerifyHundred(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0));
  const bool binary = state.range(1) != 0;
  const auto query = InStoredPrecision(MakeImage(n, 1, nullptr, 0, binary));
  std::vector<Features> candidates;
  for (std::uint64_t i = 0; i < 100; ++i) {
    candidates.push_back(
        InStoredPrecision(MakeImage(n, 2 + i, &query, i % 10 == 0 ? n / 5 : 0, binary)));
  }
  int verified = 0;
  for (auto _ : state) {
    const Verifier verifier(query);
    std::vector<char> found(candidates.size());
    ParallelFor(candidates.size(), static_cast<int>(state.range(2)), [&](std::size_t i) {
      found[i] = static_cast<char>(verifier.Verify(candidates[i]).verified());
    });
    verified = 0;
    for (const char f : found) verified += f;
  }
  state.counters["verified"] = verified;
}
BENCHMARK(VerifyHundred)
    ->ArgNames({"descriptors", "binary", "threads"})
    ->ArgsProduct({{700, 1000}, {0, 1}, {1, 2}})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pliant

BENCHMARK_MAIN();
