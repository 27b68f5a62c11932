// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/k_medoids.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/match/distance.h"
#include "vocab/distance_rows.h"
#include "vocab/fasterpam.h"
#include "vocab/seeding.h"

namespace pliant {
namespace {

// Candidates whose distances are at hand at a time.
constexpr std::size_t kBlock = 256;
constexpr std::size_t kCandidatesATask = 16;
// Candidates are tried one by one until this many in a row were no good, then many at a time.
constexpr std::size_t kQuietBeforeParallel = 64;
// A swap must lower the loss by this share of it to count: far above the rounding of the sums,
// far below anything that matters.
constexpr double kTolerance = 1e-10;
// Shares of `progress` that the matrix and the seeding take.
constexpr double kMatrixShare = 0.15;
constexpr double kSeedingShare = 0.05;

void Validate(const Descriptors& samples, const KMedoidsOptions& options) {
  const auto refuse = [](const char* reason, const std::string& message) {
    throw Error(ErrorCode::kInvalidArgument, reason, message);
  };
  if (samples.rows > kMaxKMedoidsSamples) {
    refuse("too_many_samples", "k-medoids takes at most " + std::to_string(kMaxKMedoidsSamples) +
                                   " samples, not " + std::to_string(samples.rows) +
                                   "; draw fewer.");
  }
  if (options.k < 1 || static_cast<std::size_t>(options.k) > samples.rows) {
    refuse("bad_k", "k = " + std::to_string(options.k) + " is outside 1.." +
                        std::to_string(samples.rows) + ", the number of samples.");
  }
  if (options.max_passes < 0) {
    refuse("bad_max_passes", "max_passes must be 0 (until no swap improves) or more.");
  }
  CheckDescriptors(samples, "k-medoids samples");
  // Up to here the sum of dim squared differences stays below the largest float.
  const double limit = 0.5 * std::sqrt(std::numeric_limits<float>::max() / samples.dim);
  for (const float x : samples.floats) {
    if (std::abs(x) < limit) continue;
    refuse("descriptors_out_of_range",
           "k-medoids samples: components are so large that distances overflow; scale them down.");
  }
}

class Run {
 public:
  Run(const Descriptors& samples, const KMedoidsOptions& options)
      : options_(options),
        threads_(ResolveThreads(options.threads)),
        rows_(samples, options.max_matrix_bytes, threads_,
              [this](double done) { Checkpoint(kMatrixShare * done, 0); }) {}

  KMedoidsResult Go() {
    if (options_.k == 1) {
      FindCentre();
    } else {
      Optimise();
    }
    Assign();
    if (options_.progress) options_.progress(1.0, result_.loss);
    return std::move(result_);
  }

 private:
  void Checkpoint(double done, double loss) {
    if (options_.stop.stop_requested()) {
      throw Error(ErrorCode::kCancelled, "cancelled", "k-medoids was stopped on request.");
    }
    done_ = std::max(done_, done);
    if (options_.progress) options_.progress(done_, loss);
  }

  // Distances to all samples of the rows first .. first + count - 1, computed by all threads.
  const float* Block(std::size_t first, std::size_t count) {
    if (rows_.in_memory()) return rows_.Stored(first);
    buffer_.resize(std::max(buffer_.size(), count * rows_.size()));
    ParallelFor((count + kCandidatesATask - 1) / kCandidatesATask, threads_, [&](std::size_t t) {
      const std::size_t begin = t * kCandidatesATask;
      rows_.Compute(first + begin, std::min(kCandidatesATask, count - begin),
                    buffer_.data() + begin * rows_.size());
    });
    return buffer_.data();
  }

  // k = 1: the sample with the smallest sum of distances is the exact answer.
  void FindCentre() {
    const std::size_t n = rows_.size();
    std::vector<double> sums(n, 0.0);
    for (std::size_t first = 0; first < n; first += kBlock) {
      const std::size_t count = std::min(kBlock, n - first);
      const float* distances = Block(first, count);
      for (std::size_t r = 0; r < count; ++r) {
        for (std::size_t o = 0; o < n; ++o) sums[first + r] += distances[r * n + o];
      }
      Checkpoint(kMatrixShare + (1 - kMatrixShare) * static_cast<double>(first + count) / n, 0);
    }
    const auto best = std::min_element(sums.begin(), sums.end());
    result_.medoids = {static_cast<std::uint32_t>(best - sums.begin())};
    result_.passes = 1;
    result_.converged = true;
  }

  void Optimise() {
    FasterPam pam(rows_, SeedMedoids(rows_, static_cast<std::size_t>(options_.k), options_.seed,
                                     [this](double done) {
                                       Checkpoint(kMatrixShare + kSeedingShare * done, 0);
                                     }));
    const std::size_t n = rows_.size();
    // n candidates in a row without a gain have all been tried against the same medoids: no single
    // exchange improves, which is PAM's local optimum, wherever in a pass that happens.
    quiet_ = 0;
    while (quiet_ < n && (options_.max_passes == 0 || result_.passes < options_.max_passes)) {
      for (std::size_t first = 0; first < n && quiet_ < n; first += kBlock) {
        TryBlock(&pam, first, std::min(kBlock, n - first));
        const double pass = 1.0 - std::pow(0.6, result_.passes + static_cast<double>(first) / n);
        const double quiet = static_cast<double>(quiet_) / static_cast<double>(n);
        Checkpoint(kMatrixShare + kSeedingShare +
                       (1 - kMatrixShare - kSeedingShare) * std::max(pass, quiet * quiet),
                   pam.loss());
      }
      ++result_.passes;
    }
    result_.converged = quiet_ >= n;
    result_.medoids = pam.medoids();
    std::sort(result_.medoids.begin(), result_.medoids.end());
  }

  // Tries the candidates of a block in order, and exchanges as soon as one improves ("eager").
  // Many threads look ahead together, but the first improvement in order is taken and the rest
  // tried again: the result is that of one thread.
  void TryBlock(FasterPam* pam, std::size_t first, std::size_t count) {
    const float* distances = Block(first, count);
    const std::size_t n = rows_.size();
    std::vector<Swap> swaps(count);
    for (std::size_t next = 0; next < count && quiet_ < n;) {
      const bool look_ahead = threads_ > 1 && quiet_ >= kQuietBeforeParallel;
      const std::size_t end = look_ahead ? count : next + 1;
      const std::size_t tasks = (end - next + kCandidatesATask - 1) / kCandidatesATask;
      ParallelFor(tasks, threads_, [&](std::size_t t) {
        std::vector<double> scratch;
        const std::size_t begin = next + t * kCandidatesATask;
        for (std::size_t c = begin; c < std::min(begin + kCandidatesATask, end); ++c) {
          swaps[c] =
              pam->is_medoid(first + c) ? Swap{} : pam->Evaluate(distances + c * n, &scratch);
        }
      });
      const double threshold = -kTolerance * pam->loss();
      while (next < end) {
        const std::size_t c = next++;
        if (swaps[c].change >= threshold) {
          if (++quiet_ >= n) return;
          continue;
        }
        pam->Apply(swaps[c].position, static_cast<std::uint32_t>(first + c), distances + c * n);
        ++result_.swaps;
        quiet_ = 0;
        break;
      }
    }
  }

  // Of equally near medoids the one of the lowest row.
  void Assign() {
    const std::size_t n = rows_.size();
    const std::size_t k = result_.medoids.size();
    std::vector<std::uint32_t> block;
    std::vector<float> distances;
    for (std::size_t first = 0; first < n; first += kBlock) {
      block.clear();
      for (std::size_t o = first; o < std::min(n, first + kBlock); ++o) {
        block.push_back(static_cast<std::uint32_t>(o));
      }
      rows_.Gather(block, result_.medoids, &distances);
      for (std::size_t i = 0; i < block.size(); ++i) {
        const float* row = distances.data() + i * k;
        const float* best = std::min_element(row, row + k);
        result_.assignment.push_back(static_cast<std::uint32_t>(best - row));
        result_.loss += *best;
      }
    }
  }

  const KMedoidsOptions& options_;
  int threads_;
  double done_ = 0;
  DistanceRows rows_;
  std::vector<float> buffer_;
  std::size_t quiet_ = 0;  // candidates in a row that improved nothing
  KMedoidsResult result_;
};

}  // namespace

KMedoidsResult KMedoids(const Descriptors& samples, const KMedoidsOptions& options) {
  Validate(samples, options);
  return Run(samples, options).Go();
}

}  // namespace pliant
