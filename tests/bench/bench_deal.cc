// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// DEAL stage by stage, with achieved GFLOP/s, next to the peak of oneDNN's own product.
//
//   bench_deal [--benchmark_filter=...]     all stages
//   bench_deal --json N T R                 R whole descriptions of N keypoints with T threads:
//                                           one JSON list of seconds (for compare_pytorch.py)
//
// $PLIANT_MODEL names other weights than those of deal.
//
// FLOPs are the customary ones of the plain network: two a multiply-add, convolutions counted
// without Winograd's savings. `share_of_peak` divides by the product's peak with as many threads,
// measured at the start of the run and again before every HardNet row (the better of the two).
// On a machine that other programs keep busy wall-clock shares mean little, the product being short
// enough to slip between them; `core_share` divides FLOPs a second of CPU time by the one-thread
// peak.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "descriptor/deal/network.h"
#include "descriptor/deal/primitives.h"
#include "descriptor/features/descriptor.h"
#include "tests/unit/wavy_image.h"

namespace pliant::deal {
namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 480;

struct Scene {
  DealNetwork network{LoadDealWeights(ModelPath("deal"))};
  Image image;
  GreyImage grey;
  FeatureMap map;
  std::vector<Keypoint> keypoints;
  std::vector<float> theta;
  std::vector<float> patches;
};

const Scene& SharedScene() {
  static const std::unique_ptr<const Scene> scene = [] {
    auto made = std::make_unique<Scene>();
    Scene& s = *made;
    s.image = testing::WavyImage(kWidth, kHeight, 9, 7, 1);
    s.grey = DealNetwork::ToImage(s.image);
    std::mt19937 random(2);
    s.keypoints.resize(2048);
    for (Keypoint& point : s.keypoints) {
      point.x = static_cast<float>(random() % kWidth);
      point.y = static_cast<float>(random() % kHeight);
      point.size = 2 + static_cast<float>(random() % 100) / 10;
    }
    s.map = s.network.backbone().Run(s.grey, 1);
    s.theta = s.network.localization().Theta(s.map, s.keypoints, 1);
    s.patches = s.network.Patches(s.grey, s.keypoints, s.network.Displacements(s.theta, 1), 1, 1);
    return made;
  }();
  return *scene;
}

double SecondsOf(const auto& act) {
  const auto from = std::chrono::steady_clock::now();
  act();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - from).count();
}

double ProcessCpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) * 1e-9;
}

// FLOP/s of oneDNN's f32 product, the best of several sizes and tries.
double MeasurePeak(int threads) {
  const ScopedPrimitiveThreads scope(threads);
  dnnl::stream stream(CpuEngine());
  double best = 0;
  for (const int n : {256, 512, 1024}) {
    const auto count = static_cast<std::size_t>(n) * static_cast<std::size_t>(n);
    const ProductPrimitive product({0, n, n, n}, std::vector<float>(count, 0.01F), false, {},
                                   Activation::kNone);
    const AlignedFloats source(count);
    const AlignedFloats destination(count);
    const AlignedFloats scratch(product.scratch_bytes() / sizeof(float) + 1);
    for (int i = 0; i < 12; ++i) {
      const double seconds = SecondsOf([&] {
        product.Run(stream, source.data(), destination.data(), scratch.data());
        stream.wait();
      });
      best = std::max(best, 2.0 * n * n * n / seconds);
    }
  }
  return best;
}

double Peak(int threads, bool again) {
  static std::map<int, double> peaks;
  double& peak = peaks[threads];
  if (again || peak == 0) peak = std::max(peak, MeasurePeak(threads));
  return peak;
}

// The fastest iteration stands for the machine when other programs share it.
class Stage {
 public:
  Stage(benchmark::State& state, double flops) : state_(state), flops_(flops) {}
  ~Stage() {
    const double rate = flops_ / best_;
    state_.counters["best_ms"] = best_ * 1e3;
    state_.counters["cpu_ms"] = best_cpu_ * 1e3;
    if (flops_ > 0) {
      state_.counters["GFLOP/s"] = rate / 1e9;
      state_.counters["share_of_peak"] = rate / Peak(static_cast<int>(state_.range(0)), false);
      state_.counters["core_share"] = flops_ / best_cpu_ / Peak(1, false);
    }
  }
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  void Run(const auto& act) {
    act();  // makes primitives and buffers
    for (auto _ : state_) {
      const double cpu_from = ProcessCpuSeconds();
      const double seconds = SecondsOf(act);
      best_cpu_ = std::min(best_cpu_, ProcessCpuSeconds() - cpu_from);
      best_ = std::min(best_, seconds);
      state_.SetIterationTime(seconds);
    }
  }

 private:
  benchmark::State& state_;
  double flops_;
  double best_ = 1e9;
  double best_cpu_ = 1e9;
};

int Threads(const benchmark::State& state) { return static_cast<int>(state.range(0)); }
std::size_t Count(const benchmark::State& state) {
  return static_cast<std::size_t>(state.range(1));
}

void BmProductPeak(benchmark::State& state) {
  double peak = 0;
  for (auto _ : state) peak = Peak(Threads(state), true);
  state.counters["GFLOP/s"] = peak / 1e9;
}

double ConvFlops(const ConvLayer& layer, double places) {
  return 2 * places * static_cast<double>(layer.weight.size());
}

void BmBackbone(benchmark::State& state) {
  const Scene& s = SharedScene();
  double places = kHeight * kWidth / 4;
  double flops = ConvFlops(s.network.weights().stem, places);
  places /= 4;  // the pooling
  for (const BasicBlock& block : s.network.weights().blocks) {
    places /= block.conv1.stride * block.conv1.stride;
    flops += ConvFlops(block.conv1, places) + ConvFlops(block.conv2, places);
    if (block.downsample) flops += ConvFlops(*block.downsample, places);
  }
  Stage(state, flops).Run([&] {
    benchmark::DoNotOptimize(s.network.backbone().Run(s.grey, Threads(state)));
  });
}

void BmLocalization(benchmark::State& state) {  // with the sampling of the features
  const Scene& s = SharedScene();
  const auto points = std::span(s.keypoints).first(Count(state));
  double flops = 0;
  for (const LinearLayer& layer : s.network.weights().localization) {
    flops += 2.0 * layer.inputs * layer.outputs;
  }
  Stage(state, flops * static_cast<double>(Count(state))).Run([&] {
    benchmark::DoNotOptimize(s.network.localization().Theta(s.map, points, Threads(state)));
  });
}

void BmWarp(benchmark::State& state) {
  const Scene& s = SharedScene();
  const auto theta = std::span(s.theta).first(Count(state) * kThetaValues);
  Stage(state, 2.0 * kPatchPixels * kThetaValues * static_cast<double>(Count(state))).Run([&] {
    benchmark::DoNotOptimize(s.network.Displacements(theta, Threads(state)));
  });
}

void BmPatchSampling(benchmark::State& state) {  // the fixed grid: without the warp's product
  const Scene& s = SharedScene();
  const auto points = std::span(s.keypoints).first(Count(state));
  Stage(state, 0).Run(
      [&] { benchmark::DoNotOptimize(s.network.Patches(s.grey, points, {}, 1, Threads(state))); });
}

void BmHardNet(benchmark::State& state) {
  const Scene& s = SharedScene();
  Peak(Threads(state), true);
  const auto patches = std::span(s.patches).first(Count(state) * kPatchPixels);
  double flops = 0;
  double side = kPatchSide;
  for (const ConvLayer& layer : s.network.weights().hardnet) {
    side /= layer.stride;
    flops += ConvFlops(layer, side * side);
  }
  for (const ConvLayer& layer : s.network.weights().head) {
    side -= layer.kernel_width - 1;
    flops += ConvFlops(layer, side);
  }
  Stage(state, flops * static_cast<double>(Count(state))).Run([&] {
    benchmark::DoNotOptimize(s.network.DescribePatches(patches, Threads(state)));
  });
}

void BmDescribe(benchmark::State& state) {
  const Scene& s = SharedScene();
  const auto points = std::span(s.keypoints).first(Count(state));
  Stage(state, 0).Run([&] {
    benchmark::DoNotOptimize(
        s.network.Describe(s.image, points, true, kOneSupport, Threads(state)));
  });
}

void EveryCount(benchmark::internal::Benchmark* stage) {
  stage->ArgNames({"threads", "keypoints"})->ArgsProduct({{1, 2}, {256, 1024, 2048}});
  stage->UseManualTime()->Unit(benchmark::kMillisecond);
}

BENCHMARK(BmProductPeak)->ArgName("threads")->Arg(1)->Arg(2)->Iterations(3);
BENCHMARK(BmBackbone)
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(BmLocalization)->Apply(EveryCount);
BENCHMARK(BmWarp)->Apply(EveryCount);
BENCHMARK(BmPatchSampling)->Apply(EveryCount);
BENCHMARK(BmHardNet)->Apply(EveryCount);
BENCHMARK(BmDescribe)->Apply(EveryCount);

int PrintDescribeSeconds(std::size_t count, int threads, int rounds) {
  const Scene& s = SharedScene();
  const auto points = std::span(s.keypoints).first(std::min(count, s.keypoints.size()));
  s.network.Describe(s.image, points, true, kOneSupport,
                     threads);  // makes primitives and buffers
  for (int i = 0; i < rounds; ++i) {
    const double seconds =
        SecondsOf([&] { s.network.Describe(s.image, points, true, kOneSupport, threads); });
    std::printf("%s%.6f", i == 0 ? "[" : ", ", seconds);
  }
  std::printf("]\n");
  return 0;
}

}  // namespace
}  // namespace pliant::deal

int main(int argc, char** argv) {
  if (argc == 5 && std::string(argv[1]) == "--json") {
    return pliant::deal::PrintDescribeSeconds(static_cast<std::size_t>(std::atoi(argv[2])),
                                              std::atoi(argv[3]), std::atoi(argv[4]));
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
