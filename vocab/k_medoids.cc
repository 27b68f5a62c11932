// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "vocab/k_medoids.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "descriptor/base/error.h"
#include "descriptor/base/parallel.h"
#include "descriptor/match/distance.h"

namespace pliant {
namespace {

// Rows of the N x N distance matrix of a sample: stored if the matrix fits in memory, otherwise
// recomputed on each access. Both give bit-identical values.
class DistanceRows {
 public:
  // Keeps the whole matrix if it takes at most `max_matrix_bytes`. `samples` must outlive this.
  // `checkpoint` is called periodically with the fraction of the matrix that is done, from this
  // thread, and may throw to cancel.
  DistanceRows(const Descriptors& samples, std::uint64_t max_matrix_bytes, int threads,
               const std::function<void(double done)>& checkpoint)
      : samples_(samples), packed_(samples), threads_(threads) {
    constexpr std::size_t kRowsACheckpoint = 1024;
    const std::size_t n = size();
    if (std::uint64_t{n} * n * sizeof(float) > max_matrix_bytes) return;
    matrix_.resize(n * n);
    for (std::size_t first = 0; first < n; first += kRowsACheckpoint) {
      Compute(first, std::min(kRowsACheckpoint, n - first), matrix_.data() + first * n);
      checkpoint(static_cast<double>(first) / static_cast<double>(n));
    }
  }

  std::size_t size() const { return samples_.rows; }

  // Rows first .. first + count - 1, count x size(), from the matrix or computed into `buffer`.
  const float* Rows(std::size_t first, std::size_t count, std::vector<float>* buffer) const {
    if (!matrix_.empty()) return matrix_.data() + first * size();
    buffer->resize(std::max(buffer->size(), count * size()));
    Compute(first, count, buffer->data());
    return buffer->data();
  }

  // out[i * columns.size() + j] = distance of sample rows[i] to sample columns[j].
  void Gather(std::span<const std::uint32_t> rows, std::span<const std::uint32_t> columns,
              std::vector<float>* out) const {
    out->resize(std::max(out->size(), rows.size() * columns.size()));
    if (matrix_.empty()) {
      const PackedDescriptors right(SelectRows(samples_, columns));
      right.Distances(SelectRows(samples_, rows), 0, rows.size(), out->data());
      return;
    }
    float* to = out->data();
    for (const std::uint32_t row : rows) {
      const float* distances = matrix_.data() + row * size();
      for (const std::uint32_t column : columns) *to++ = distances[column];
    }
  }

 private:
  void Compute(std::size_t first, std::size_t count, float* out) const {
    // Many rows share what they read of the samples; few rows a task keep all threads busy.
    const std::size_t a_task =
        std::clamp<std::size_t>(count / (4 * static_cast<std::size_t>(threads_)), 16, 64);
    ParallelFor((count + a_task - 1) / a_task, threads_, [&](std::size_t t) {
      const std::size_t begin = t * a_task;
      packed_.Distances(samples_, first + begin, std::min(a_task, count - begin),
                        out + begin * size());
    });
  }

  const Descriptors& samples_;
  PackedDescriptors packed_;
  int threads_;
  std::vector<float> matrix_;  // size() x size(), or empty
};

// The effect on the loss of exchanging a medoid for a candidate.
struct Swap {
  std::uint32_t position = 0;  // of the medoid to be removed
  double change = 0;           // of the loss; below 0 is better
};

// The state and the two steps of FasterPAM (Schubert and Rousseeuw 2021, Algorithm 3).
class FasterPam {
 public:
  // `medoids`: k >= 2 distinct rows.
  FasterPam(const DistanceRows& rows, std::vector<std::uint32_t> medoids)
      : rows_(rows),
        medoids_(std::move(medoids)),
        is_medoid_(rows.size(), 0),
        nearest_(rows.size()),
        second_(rows.size()),
        nearest_distance_(rows.size()),
        second_distance_(rows.size()),
        removal_loss_(medoids_.size()) {
    for (const std::uint32_t m : medoids_) is_medoid_[m] = 1;
    std::vector<std::uint32_t> all(rows.size());
    std::iota(all.begin(), all.end(), 0U);
    Search(all);
    UpdateSums();
  }

  const std::vector<std::uint32_t>& medoids() const { return medoids_; }
  bool is_medoid(std::size_t row) const { return is_medoid_[row] != 0; }
  double loss() const { return loss_; }

  // The best medoid to exchange for the candidate whose distances to all samples are `distances`:
  // O(N + k), since the cost of removing each medoid is maintained. `scratch` belongs to the
  // caller. Thread-safe.
  Swap Evaluate(const float* distances, std::vector<double>* scratch) const {
    // change[i]: of removing medoid i and adding the candidate, less what the candidate saves
    // whichever medoid goes (`saved`). With d the distance to the candidate, a sample's share is
    //   saved += min(d - nearest, 0),  change[its medoid] += min(max(d, nearest), second) - second,
    // written without branches, which would be mispredicted; but few samples have the candidate
    // nearer than their second medoid when k is large, so chunks without one are left out.
    std::vector<double>& change = *scratch;
    change.assign(removal_loss_.begin(), removal_loss_.end());
    constexpr std::size_t kChunk = 16;
    double saved[kChunk] = {};
    double less[kChunk];
    const std::size_t n = rows_.size();
    for (std::size_t first = 0; first < n; first += kChunk) {
      const std::size_t count = std::min(kChunk, n - first);
      const float* d = distances + first;
      const float* near = nearest_distance_.data() + first;
      const float* second = second_distance_.data() + first;
      const std::uint32_t* medoid = nearest_.data() + first;
      int any = 0;
      for (std::size_t j = 0; j < count; ++j) any |= static_cast<int>(d[j] < second[j]);
      if (any == 0) continue;
      for (std::size_t j = 0; j < count; ++j) {
        saved[j] += static_cast<double>(std::min(d[j], near[j])) - static_cast<double>(near[j]);
        less[j] = static_cast<double>(std::min(std::max(d[j], near[j]), second[j])) -
                  static_cast<double>(second[j]);
      }
      for (std::size_t j = 0; j < count; ++j) change[medoid[j]] += less[j];
    }
    const auto best = std::min_element(change.begin(), change.end());
    return {static_cast<std::uint32_t>(best - change.begin()),
            *best + std::accumulate(saved, saved + kChunk, 0.0)};
  }

  // Exchanges the medoid at `position` for `candidate`.
  void Apply(std::uint32_t position, std::uint32_t candidate, const float* distances) {
    is_medoid_[medoids_[position]] = 0;
    is_medoid_[candidate] = 1;
    medoids_[position] = candidate;
    orphans_.clear();
    for (std::size_t o = 0; o < rows_.size(); ++o) {
      const float d = distances[o];
      if (nearest_[o] == position || second_[o] == position) {
        // One of the two went away. Where the candidate takes its place or a better one, the other
        // of the two is still right; else the next nearest must be looked for.
        const bool was_nearest = nearest_[o] == position;
        const std::uint32_t kept = was_nearest ? second_[o] : nearest_[o];
        const float kept_distance = was_nearest ? second_distance_[o] : nearest_distance_[o];
        if (d > second_distance_[o]) {
          orphans_.push_back(static_cast<std::uint32_t>(o));
        } else if (d < kept_distance) {
          nearest_[o] = position;
          nearest_distance_[o] = d;
          second_[o] = kept;
          second_distance_[o] = kept_distance;
        } else {
          nearest_[o] = kept;
          nearest_distance_[o] = kept_distance;
          second_[o] = position;
          second_distance_[o] = d;
        }
      } else if (d < nearest_distance_[o]) {
        second_[o] = nearest_[o];
        second_distance_[o] = nearest_distance_[o];
        nearest_[o] = position;
        nearest_distance_[o] = d;
      } else if (d < second_distance_[o]) {
        second_[o] = position;
        second_distance_[o] = d;
      }
    }
    Search(orphans_);
    UpdateSums();
  }

 private:
  static constexpr std::size_t kSearchBlock =
      512;  // samples whose distances are gathered at a time

  // Sets nearest and second nearest of the listed samples from the distances to all medoids.
  void Search(const std::vector<std::uint32_t>& samples) {
    const std::size_t k = medoids_.size();
    for (std::size_t first = 0; first < samples.size(); first += kSearchBlock) {
      const std::span block(samples.data() + first, std::min(kSearchBlock, samples.size() - first));
      rows_.Gather(block, medoids_, &gathered_);
      for (std::size_t i = 0; i < block.size(); ++i) {
        const float* distances = gathered_.data() + i * k;
        std::uint32_t best = 0;
        std::uint32_t second = 1;
        if (distances[second] < distances[best]) std::swap(best, second);
        for (std::uint32_t m = 2; m < k; ++m) {
          if (distances[m] >= distances[second]) continue;
          second = m;
          if (distances[second] < distances[best]) std::swap(best, second);
        }
        const std::uint32_t o = block[i];
        nearest_[o] = best;
        second_[o] = second;
        nearest_distance_[o] = distances[best];
        second_distance_[o] = distances[second];
      }
    }
  }

  // removal_loss_: when a medoid goes, its samples move to their second nearest, and no others move
  // (the paper's Delta TD^-). Sums again instead of adding changes, so that no rounding error
  // gathers over the swaps.
  void UpdateSums() {
    std::fill(removal_loss_.begin(), removal_loss_.end(), 0.0);
    loss_ = 0;
    for (std::size_t o = 0; o < rows_.size(); ++o) {
      loss_ += nearest_distance_[o];
      removal_loss_[nearest_[o]] +=
          static_cast<double>(second_distance_[o]) - static_cast<double>(nearest_distance_[o]);
    }
  }

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

// A number in [0, 1) from the generator's upper 53 bits: the same on every standard library,
// which std::uniform_real_distribution does not promise.
double Uniform(std::mt19937_64* generator) {
  return static_cast<double>((*generator)() >> 11) * 0x1.0p-53;
}

// k distinct rows. Each is drawn with a probability proportional to its distance from the nearest
// row drawn before: k-means++ (Arthur and Vassilvitskii 2007) for a loss of plain distances. When
// all distances are 0, the lowest remaining rows are used. O(k N). `checkpoint` as in DistanceRows.
std::vector<std::uint32_t> SeedMedoids(const DistanceRows& rows, std::size_t k, std::uint64_t seed,
                                       const std::function<void(double done)>& checkpoint) {
  const std::size_t n = rows.size();
  std::mt19937_64 generator(seed);
  std::vector<float> nearest(n, std::numeric_limits<float>::infinity());
  std::vector<char> taken(n, 0);
  std::vector<float> buffer;
  std::vector<std::uint32_t> medoids;
  const auto take = [&](std::size_t row) {
    medoids.push_back(static_cast<std::uint32_t>(row));
    taken[row] = 1;
    const float* distances = rows.Rows(row, 1, &buffer);
    for (std::size_t i = 0; i < n; ++i) nearest[i] = std::min(nearest[i], distances[i]);
  };
  take(std::min(n - 1, static_cast<std::size_t>(Uniform(&generator) * static_cast<double>(n))));
  while (medoids.size() < k) {
    if (medoids.size() % 64 == 0) {
      checkpoint(static_cast<double>(medoids.size()) / static_cast<double>(k));
    }
    double total = 0;
    for (const float d : nearest) total += d;
    if (total <= 0) break;
    double left = Uniform(&generator) * total;
    std::size_t chosen = n;
    for (std::size_t i = 0; i < n && (chosen == n || left > 0); ++i) {
      if (nearest[i] <= 0) continue;
      chosen = i;
      left -= nearest[i];
    }
    take(chosen);
  }
  for (std::size_t i = 0; i < n && medoids.size() < k; ++i) {
    if (taken[i] == 0) medoids.push_back(static_cast<std::uint32_t>(i));
  }
  return medoids;
}

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

  // k = 1: the sample with the smallest sum of distances is the exact answer.
  void FindCentre() {
    const std::size_t n = rows_.size();
    std::vector<double> sums(n, 0.0);
    for (std::size_t first = 0; first < n; first += kBlock) {
      const std::size_t count = std::min(kBlock, n - first);
      const float* distances = rows_.Rows(first, count, &buffer_);
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
    const float* distances = rows_.Rows(first, count, &buffer_);
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
