// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Vocabulary training and assignment. The loss is printed beside the time, so that a faster run
// that is a worse one shows.
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include <benchmark/benchmark.h>
#ifdef PLIANT_WITH_FAISS
#include <faiss/IndexFlat.h>
#include <omp.h>
#endif

#include "vocab/hierarchical_k_medoids.h"
#include "vocab/k_medoids.h"
#include "vocab/quantizer.h"

namespace pliant {
namespace {

constexpr int kDim = 128;
constexpr int kBytes = 32;
constexpr int kKinds = 300;

// Unit vectors scattered around 300 directions: about as hard to cluster as local descriptors.
Descriptors Floats(std::size_t rows) {
  std::mt19937_64 generator(7);
  std::normal_distribution<float> normal;
  auto kinds = Descriptors::Float(kKinds, kDim);
  for (float& x : kinds.floats) x = normal(generator);
  auto out = Descriptors::Float(rows, kDim);
  for (std::size_t i = 0; i < rows; ++i) {
    const auto kind = kinds.float_row(generator() % kKinds);
    float* row = out.floats.data() + i * kDim;
    float norm = 0;
    for (int p = 0; p < kDim; ++p) {
      row[p] = kind[p] + normal(generator);
      norm += row[p] * row[p];
    }
    for (int p = 0; p < kDim; ++p) row[p] /= std::sqrt(norm);
  }
  return out;
}

// 256 bits around 300 patterns, every eighth bit flipped.
Descriptors Bits(std::size_t rows) {
  std::mt19937_64 generator(7);
  auto kinds = Descriptors::Binary(kKinds, kBytes);
  for (auto& x : kinds.bytes) x = static_cast<std::uint8_t>(generator());
  auto out = Descriptors::Binary(rows, kBytes);
  for (std::size_t i = 0; i < rows; ++i) {
    const auto kind = kinds.binary_row(generator() % kKinds);
    for (int p = 0; p < kBytes; ++p) {
      const auto noise = generator() & generator() & generator();
      out.bytes[i * kBytes + p] = static_cast<std::uint8_t>(kind[p] ^ noise);
    }
  }
  return out;
}

Descriptors Make(bool binary, std::size_t rows) { return binary ? Bits(rows) : Floats(rows); }

void TrainKMedoids(benchmark::State& state, bool binary) {
  const auto samples = Make(binary, static_cast<std::size_t>(state.range(0)));
  KMedoidsOptions options;
  options.k = static_cast<int>(state.range(1));
  options.threads = static_cast<int>(state.range(2));
  KMedoidsResult result;
  for (auto _ : state) result = KMedoids(samples, options);
  state.counters["mean_loss"] = result.loss / static_cast<double>(samples.rows);
  state.counters["swaps"] = result.swaps;
  state.counters["passes"] = result.passes;
}
BENCHMARK_CAPTURE(TrainKMedoids, float128, false)
    ->ArgNames({"n", "k", "threads"})
    ->ArgsProduct({{10'000}, {10, 100, 1000}, {1, 2}})
    ->Args({4000, 400, 2})
    ->Args({8000, 800, 2})
    ->Args({16'000, 1600, 2})
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(TrainKMedoids, binary256, true)
    ->ArgNames({"n", "k", "threads"})
    ->ArgsProduct({{10'000}, {10, 1000}, {2}})
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

// The tree beside FasterPAM on the same samples (first row), and at sizes that only the tree takes.
void TrainTree(benchmark::State& state, bool binary) {
  const auto samples = Make(binary, static_cast<std::size_t>(state.range(0)));
  KMedoidsOptions options;
  options.k = static_cast<int>(state.range(1));
  options.threads = static_cast<int>(state.range(2));
  HierarchicalKMedoidsResult result;
  for (auto _ : state) result = HierarchicalKMedoids(samples, options);
  state.counters["mean_loss"] = result.mean_loss;
}
BENCHMARK_CAPTURE(TrainTree, float128, false)
    ->ArgNames({"n", "k", "threads"})
    ->Args({4000, 400, 2})
    ->Args({8000, 800, 2})
    ->Args({10'000, 1000, 2})
    ->Args({16'000, 1600, 2})
    ->Args({100'000, 1000, 2})
    ->Args({100'000, 10'000, 2})
    ->Args({1'000'000, 65'536, 2})
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(TrainTree, binary256, true)
    ->ArgNames({"n", "k", "threads"})
    ->Args({10'000, 1000, 2})
    ->Args({100'000, 10'000, 2})
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

void AssignWords(benchmark::State& state, bool binary) {
  auto vocabulary = std::make_shared<Vocabulary>();
  vocabulary->words = Make(binary, static_cast<std::size_t>(state.range(0)));
  const Quantizer quantizer(vocabulary);
  auto rows = Make(binary, vocabulary->size() + 4000);
  rows.rows -= vocabulary->size();  // others than the words
  if (binary) {
    rows.bytes.erase(rows.bytes.begin(), rows.bytes.end() - rows.rows * kBytes);
  } else {
    rows.floats.erase(rows.floats.begin(), rows.floats.end() - rows.rows * kDim);
  }
  const int threads = static_cast<int>(state.range(1));
  for (auto _ : state) benchmark::DoNotOptimize(quantizer.Assign(rows, threads));
  const auto assigned = static_cast<double>(state.iterations() * rows.rows);
  state.counters["descriptors/s"] = {assigned, benchmark::Counter::kIsRate};
  if (!binary) {
    state.counters["GFLOP/s"] = {2e-9 * assigned * static_cast<double>(vocabulary->size()) * kDim,
                                 benchmark::Counter::kIsRate};
  }
}
BENCHMARK_CAPTURE(AssignWords, float128, false)
    ->ArgNames({"words", "threads"})
    ->ArgsProduct({{10, 1000, 10'000, 65'536}, {1, 2}})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(AssignWords, binary256, true)
    ->ArgNames({"words", "threads"})
    ->ArgsProduct({{1000, 10'000}, {1, 2}})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

#ifdef PLIANT_WITH_FAISS
// Faiss' exact search for the nearest of as many words as above, in the same run.
void FaissExact(benchmark::State& state) {
  const auto words = Floats(static_cast<std::size_t>(state.range(0)));
  auto rows = Floats(words.rows + 4000);
  rows.floats.erase(rows.floats.begin(), rows.floats.end() - 4000 * kDim);
  omp_set_num_threads(static_cast<int>(state.range(1)));
  faiss::IndexFlatL2 index(kDim);
  index.add(static_cast<std::int64_t>(words.rows), words.floats.data());
  std::vector<float> distances(4000);
  std::vector<std::int64_t> labels(4000);
  for (auto _ : state) index.search(4000, rows.floats.data(), 1, distances.data(), labels.data());
  const auto assigned = static_cast<double>(state.iterations() * 4000);
  state.counters["descriptors/s"] = {assigned, benchmark::Counter::kIsRate};
}
BENCHMARK(FaissExact)
    ->ArgNames({"words", "threads"})
    ->ArgsProduct({{1000, 10'000, 65'536}, {1, 2}})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
#endif

}  // namespace
}  // namespace pliant

BENCHMARK_MAIN();
