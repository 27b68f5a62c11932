// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What decoding in a process of its own costs: the same JPEG decoded inside and by a waiting
// decoder, to what is described (grey, longer side 1024), and how long it takes to start a decoder.
// `cpu_ms` is the processor time of an image, of this process and the decoder together: on a busy
// machine it says more than the time that passed.
//
//   bench_decoder --benchmark_enable_random_interleaving=true --benchmark_repetitions=9
//     --benchmark_report_aggregates_only=true
#include <cstdint>
#include <ctime>
#include <memory>
#include <vector>

#include <benchmark/benchmark.h>

#include "server/decoder/decoder_pool.h"
#include "tests/unit/wavy_image.h"

namespace pliant::server {
namespace {

constexpr const char* kProgram = PLIANT_BINARY_DIR "/bin/pliant-server";

std::vector<std::uint8_t> Jpeg(const benchmark::State& state) {
  const int width = static_cast<int>(state.range(0));
  const int height = static_cast<int>(state.range(1));
  return EncodeJpeg(testing::WavyImage(width, height, 9, 7, 1));
}

double CpuMs(clockid_t clock) {
  timespec used{};
  clock_gettime(clock, &used);
  return static_cast<double>(used.tv_sec) * 1e3 + static_cast<double>(used.tv_nsec) * 1e-6;
}

void Report(benchmark::State& state, std::size_t file_bytes, double cpu_ms) {
  state.counters["file_bytes"] = static_cast<double>(file_bytes);
  state.counters["cpu_ms"] = cpu_ms / static_cast<double>(state.iterations());
}

void Inside(benchmark::State& state) {
  const std::vector<std::uint8_t> file = Jpeg(state);
  const double before = CpuMs(CLOCK_PROCESS_CPUTIME_ID);
  for (auto _ : state) benchmark::DoNotOptimize(DecodeImage(file));
  Report(state, file.size(), CpuMs(CLOCK_PROCESS_CPUTIME_ID) - before);
}

void Process(benchmark::State& state) {
  const std::vector<std::uint8_t> file = Jpeg(state);
  DecoderOptions options;
  options.program = kProgram;
  DecoderPool pool(options);
  clockid_t decoder{};
  clock_getcpuclockid(pool.WaitingIds().at(0), &decoder);
  const auto both = [&] { return CpuMs(CLOCK_PROCESS_CPUTIME_ID) + CpuMs(decoder); };
  const double before = both();
  for (auto _ : state) benchmark::DoNotOptimize(pool.Decode(file, {}));
  Report(state, file.size(), both() - before);
}

void Start(benchmark::State& state) {
  DecoderOptions options;
  options.program = kProgram;
  for (auto _ : state) benchmark::DoNotOptimize(std::make_unique<DecoderPool>(options)->size());
}

void Sizes(benchmark::internal::Benchmark* bench) {
  bench->Args({1024, 768})->Args({4000, 3000})->UseRealTime()->Unit(benchmark::kMillisecond);
}

BENCHMARK(Inside)->Apply(Sizes);
BENCHMARK(Process)->Apply(Sizes);
BENCHMARK(Start)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace pliant::server

BENCHMARK_MAIN();
