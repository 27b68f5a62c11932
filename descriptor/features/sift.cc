// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/features/sift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <memory>
#include <new>
#include <optional>
#include <tuple>
#include <utility>

#include <opencv2/core/hal/hal.hpp>

#include "descriptor/base/parallel.h"
#include "descriptor/features/sift_kernels.h"

namespace pliant::sift {
namespace {

// Lowe's constants, as OpenCV has them.
constexpr double kSigma = 1.6;        // of an octave's first level, in its pixels
constexpr double kImageSigma = 0.5;   // blur that an image is taken to have
constexpr double kEdgeRatio = 10;     // of the principal curvatures, at most
constexpr int kBorder = 5;            // pixels without keypoints
constexpr int kSteps = 5;             // of the refinement, at most
constexpr int kBins = 36;             // of orientations
constexpr double kPeak = 0.8;         // of the highest bin: a further orientation
constexpr double kWindowSigma = 1.5;  // of the orientation, in units of the keypoint's sigma
constexpr float kGrey = 1.0F / 255;

constexpr int kReach = 3;  // pixels that the refinement moves, at most

constexpr int kRowsOfABlock = 8;       // blurred together
constexpr int kColumnsOfABlock = 128;  // 8 + 2 x 12 rows of these stay in the first-level cache
constexpr int kRowsOfABand = 32;       // of the first level, of one thread at a time
constexpr int kColumnsOfATile =
    640;  // the levels' last rows of a tile stay in the second-level cache

struct Free {
  void operator()(float* memory) const { std::free(memory); }
};
using Floats = std::unique_ptr<float, Free>;

Floats Allocate(std::size_t count) {
  constexpr std::size_t kLine = 64;
  const std::size_t bytes = (count * sizeof(float) + kLine - 1) / kLine * kLine;
  void* const memory = std::aligned_alloc(kLine, bytes);
  if (memory == nullptr) throw std::bad_alloc();
  return Floats(static_cast<float*>(memory));
}

int RoundUp(int width) { return (width + kLanes - 1) / kLanes * kLanes; }

// Values of a row: a vector more than needed, so that a load may begin anywhere, and an odd number
// of cache lines, so that the rows above each other do not fall into the same set of the cache.
int StrideOf(int width) {
  const int lines = RoundUp(width) / kLanes + 1;
  return (lines | 1) * kLanes;
}

struct Plane {
  Plane() = default;
  Plane(int plane_width, int plane_height)
      : width(plane_width),
        height(plane_height),
        stride(StrideOf(plane_width)),
        values(Allocate(static_cast<std::size_t>(stride) * static_cast<std::size_t>(height))) {}

  float* row(int y) { return values.get() + static_cast<std::ptrdiff_t>(y) * stride; }
  const float* row(int y) const { return values.get() + static_cast<std::ptrdiff_t>(y) * stride; }

  int width = 0, height = 0, stride = 0;
  Floats values;
};

// Without repeating the edge: -1 is 1.
int Reflected(int at, int size) {
  if (size == 1) return 0;
  while (at < 0 || at >= size) at = at < 0 ? -at : 2 * (size - 1) - at;
  return at;
}

// Of one side, from the middle on.
std::vector<float> GaussianTaps(double sigma) {
  constexpr double kSigmas = 4;
  const int width = static_cast<int>(std::lround(sigma * kSigmas * 2 + 1)) | 1;
  std::vector<double> taps(static_cast<std::size_t>(width / 2 + 1));
  double sum = 0;
  for (std::size_t i = 0; i < taps.size(); ++i) {
    const auto at = static_cast<double>(i);
    taps[i] = std::exp(-at * at / (2 * sigma * sigma));
    sum += i == 0 ? taps[i] : 2 * taps[i];
  }
  for (double& tap : taps) tap /= sum;
  return {taps.begin(), taps.end()};
}

// Blurs rows, reflected at the edges of the image. For one thread.
class RowBlur {
 public:
  RowBlur(double sigma, int width)
      : taps_(GaussianTaps(sigma)),
        radius_(static_cast<int>(taps_.size()) - 1),
        width_(width),
        before_(RoundUp(radius_)),
        stride_(before_ + StrideOf(width + radius_)),
        columns_(Allocate(static_cast<std::size_t>(stride_) * kRowsOfABlock)),
        rows_(static_cast<std::size_t>(kRowsOfABlock + 2 * radius_)) {}

  int radius() const { return radius_; }

  // Rows first to end - 1 of an image of so many rows: from(y) to out(y).
  template <typename From, typename Out>
  void Run(int first, int end, int height, const From& from, const Out& out) {
    for (int top = first; top < end; top += kRowsOfABlock) {
      const int count = std::min(kRowsOfABlock, end - top);
      // Rows are blurred in pairs; an odd one at the end has a partner that nobody reads.
      const int needed = count + 2 * radius_;
      for (int i = 0; i < needed + count % 2; ++i) {
        const int y = top - radius_ + std::min(i, needed - 1);
        rows_[static_cast<std::size_t>(i)] = from(Reflected(y, height));
      }
      for (int left = 0; left < width_; left += kColumnsOfABlock) {
        const int right = std::min(left + kColumnsOfABlock, RoundUp(width_));
        for (int i = 0; i < count; i += 2) {
          float* const upper = columns_.get() + i * stride_ + before_;
          BestKernels().blur_columns(rows_.data() + i, taps_.data(), radius_, left, right, upper,
                                     upper + stride_);
        }
      }
      for (int i = 0; i < count; ++i) {
        float* const row = columns_.get() + i * stride_ + before_;
        for (int j = 1; j <= radius_; ++j) {
          row[-j] = row[Reflected(-j, width_)];
          row[width_ - 1 + j] = row[Reflected(width_ - 1 + j, width_)];
        }
        BestKernels().blur_row(row, taps_.data(), radius_, RoundUp(width_), out(top + i));
      }
    }
  }

 private:
  std::vector<float> taps_;
  int radius_, width_, before_, stride_;
  Floats columns_;
  std::vector<const float*> rows_;
};

// Row y of an image twice as large, by linear interpolation.
void DoubledRow(const Image& grey, int y, float* out) {
  const auto row = [&](int at) {
    return grey.pixels.data() +
           static_cast<std::ptrdiff_t>(std::clamp(at, 0, grey.height - 1)) * grey.width;
  };
  const std::uint8_t* const near = row(y / 2);
  const std::uint8_t* const far = row(y % 2 == 0 ? y / 2 - 1 : y / 2 + 1);
  const auto at = [&](int x) {
    return 0.75F * static_cast<float>(near[x]) + 0.25F * static_cast<float>(far[x]);
  };
  float left = at(0);
  float middle = left;
  for (int x = 0; x < grey.width; ++x) {
    const float right = at(std::min(x + 1, grey.width - 1));
    out[2 * x] = 0.25F * left + 0.75F * middle;
    out[2 * x + 1] = 0.75F * middle + 0.25F * right;
    left = middle;
    middle = right;
  }
}

// The first level of the first octave: the image twice as large.
Plane FirstLevel(const Image& grey, int threads) {
  Plane level(2 * grey.width, 2 * grey.height);
  const double blurred = 2 * kImageSigma;
  const auto bands = static_cast<std::size_t>((level.height + kRowsOfABand - 1) / kRowsOfABand);
  ParallelFor(bands, threads, [&](std::size_t band) {
    const int first = static_cast<int>(band) * kRowsOfABand;
    const int end = std::min(level.height, first + kRowsOfABand);
    RowBlur blur(std::sqrt(kSigma * kSigma - blurred * blurred), level.width);
    const int top = std::max(0, first - blur.radius());
    Plane doubled(level.width, std::min(level.height, end + blur.radius()) - top);
    for (int y = 0; y < doubled.height; ++y) DoubledRow(grey, top + y, doubled.row(y));
    blur.Run(
        first, end, level.height, [&](int y) { return doubled.row(y - top); },
        [&](int y) { return level.row(y); });
  });
  return level;
}

// Blur of a level in pixels of its octave.
double SigmaOf(int level) { return kSigma * std::exp2(static_cast<double>(level) / kLayers); }

// That takes one level to another.
double SigmaBetween(int from, int to) {
  return std::sqrt(SigmaOf(to) * SigmaOf(to) - SigmaOf(from) * SigmaOf(from));
}

// A keypoint and the pixel that it was refined from.
struct Candidate {
  Keypoint keypoint;
  int octave = 0, layer = 0, x = 0, y = 0;
};

struct Tile {
  int left = 0, right = 0, top = 0, bottom = 0;
};

// The keypoints of a tile of an octave. Of the levels above the first, only the last rows are kept:
// each is blurred from the one below as far as the next one needs it.
class TileSearch {
 public:
  TileSearch(const Plane& first_level, int octave, double contrast, const Tile& tile)
      : base_(first_level), octave_(octave), contrast_(contrast), tile_(tile) {
    std::array<int, kLevels> margin{};  // rows and columns of a level around the tile
    margin[kLevels - 1] = kReach + 1;
    for (int i = kLevels - 1; i > 0; --i) {
      const auto radius = static_cast<int>(GaussianTaps(SigmaBetween(i - 1, i)).size()) - 1;
      margin[static_cast<std::size_t>(i - 1)] = margin[static_cast<std::size_t>(i)] + radius;
    }
    left_ = std::max(0, tile.left - margin[0]) / kLanes * kLanes;
    width_ = std::min(base_.width, tile.right + margin[0]) - left_;
    stride_ = StrideOf(width_);
    for (int i = 1; i < kLevels; ++i) {
      Level& level = levels_[static_cast<std::size_t>(i)];
      level.margin = margin[static_cast<std::size_t>(i)];
      level.next = std::max(0, tile.top - level.margin);
      const int above =
          i + 1 < kLevels ? level.margin - margin[static_cast<std::size_t>(i + 1)] : 0;
      level.kept = kRowsOfABlock + std::max(level.margin + kReach + 1, 2 * above);
      level.rows =
          Allocate(static_cast<std::size_t>(level.kept) * static_cast<std::size_t>(stride_));
      level.blur = std::make_unique<RowBlur>(SigmaBetween(i - 1, i), width_);
    }
  }

  // next: the first level of the next octave, if there is one, of which this fills what it has.
  std::vector<Candidate> Run(Plane* next) {
    std::vector<Candidate> found;
    scratch_ = Allocate(static_cast<std::size_t>(stride_) * 3 * kLayers);
    bits_.resize(static_cast<std::size_t>(stride_));
    // Levels begin with the first row of their margins, a few rows at a time.
    const int before = (2 * levels_[1].margin + kRowsOfABlock - 1) / kRowsOfABlock * kRowsOfABlock;
    for (int y = tile_.top - before; y < tile_.bottom; y += kRowsOfABlock) {
      const int end = std::min(tile_.bottom, y + kRowsOfABlock);
      for (int i = 1; i < kLevels; ++i) Extend(i, end);
      for (int row = std::max(tile_.top, y); row < end; ++row) {
        if (next != nullptr) Halve(row, next);
        if (row >= kBorder && row < base_.height - kBorder) FindInRow(row, &found);
      }
    }
    return found;
  }

 private:
  struct Level {
    int margin = 0;
    int next = 0;  // row that comes next
    int kept = 0;  // rows
    Floats rows;
    std::unique_ptr<RowBlur> blur;  // from the level below
  };

  const float* Row(int level, int y) const {
    return level == 0 ? base_.row(y) + left_ : RowOf(levels_[static_cast<std::size_t>(level)], y);
  }

  float* RowOf(const Level& level, int y) const {
    return level.rows.get() + static_cast<std::ptrdiff_t>(y % level.kept) * stride_;
  }

  // Blurs the rows of a level that the tile's rows above `end` need.
  void Extend(int i, int end) {
    Level& level = levels_[static_cast<std::size_t>(i)];
    const int last = std::min(base_.height, end + level.margin);
    level.blur->Run(
        level.next, last, base_.height, [&](int y) { return Row(i - 1, y); },
        [&](int y) { return RowOf(level, y); });
    level.next = std::max(level.next, last);
  }

  // Takes the nearest pixels.
  void Halve(int y, Plane* next) const {
    const double down = static_cast<double>(base_.height) / next->height;
    const double right = static_cast<double>(base_.width) / next->width;
    const int row = static_cast<int>(std::ceil(y / down));
    if (row >= next->height || static_cast<int>(row * down) != y) return;
    const float* const from = Row(kLayers, y);
    for (int x = static_cast<int>(std::ceil(tile_.left / right)); x < next->width; ++x) {
      const int column = static_cast<int>(x * right);
      if (column >= tile_.right) break;
      next->row(row)[x] = from[column - left_];
    }
  }

  void FindInRow(int y, std::vector<Candidate>* to) {
    const int first = std::max(tile_.left, kBorder) - left_;
    const int end = std::min(tile_.right, base_.width - kBorder) - left_;
    if (first >= end) return;
    LevelRows rows;
    for (int i = 0; i < kLevels; ++i) {
      rows[static_cast<std::size_t>(i)] = {Row(i, y - 1), Row(i, y), Row(i, y + 1)};
    }
    // Half of what refined ones need. OpenCV rounds it down, which lets only more candidates
    // through.
    const auto threshold = static_cast<float>(0.5 * contrast_ / kLayers * 255);
    BestKernels().find_extrema(rows, threshold, RoundUp(width_), stride_, scratch_.get(),
                               bits_.data());
    const auto is_any = [](std::int32_t bits) { return bits != 0; };
    const auto last = bits_.begin() + end;
    for (auto at = std::find_if(bits_.begin() + first, last, is_any); at != last;
         at = std::find_if(at + 1, last, is_any)) {
      for (int i = 0; i < kLayers; ++i) {
        if ((*at >> i & 1) == 0) continue;
        const auto refined = Refine(i + 1, static_cast<int>(at - bits_.begin()), y);
        if (refined) to->push_back(*refined);
      }
    }
  }

  // To the extremum of a quadratic function through the neighbours (Brown and Lowe 2002). Absent
  // where there is none nearby, where the contrast is low, and on edges. x is in the tile's rows.
  std::optional<Candidate> Refine(int layer, const int from_x, const int from_y) const {
    constexpr float kFirst = kGrey * 0.5F;
    constexpr float kCross = kGrey * 0.25F;
    int x = from_x;
    int y = from_y;
    for (int step = 0; step < kSteps; ++step) {
      std::array<std::array<const float*, 3>, 4> rows;  // of four levels: three differences
      for (int i = 0; i < 4; ++i) {
        for (int j = 0; j < 3; ++j) rows[i][j] = Row(layer - 1 + i, y - 1 + j) + x;
      }
      const auto at = [&](int right, int down, int up) {
        return rows[up + 2][down + 1][right] - rows[up + 1][down + 1][right];
      };
      const float centre = at(0, 0, 0);
      const std::array<float, 3> slope = {(at(1, 0, 0) - at(-1, 0, 0)) * kFirst,
                                          (at(0, 1, 0) - at(0, -1, 0)) * kFirst,
                                          (at(0, 0, 1) - at(0, 0, -1)) * kFirst};
      const float xx = (at(1, 0, 0) + at(-1, 0, 0) - 2 * centre) * kGrey;
      const float yy = (at(0, 1, 0) + at(0, -1, 0) - 2 * centre) * kGrey;
      const float ss = (at(0, 0, 1) + at(0, 0, -1) - 2 * centre) * kGrey;
      const float xy = (at(1, 1, 0) - at(-1, 1, 0) - at(1, -1, 0) + at(-1, -1, 0)) * kCross;
      const float xs = (at(1, 0, 1) - at(-1, 0, 1) - at(1, 0, -1) + at(-1, 0, -1)) * kCross;
      const float ys = (at(0, 1, 1) - at(0, -1, 1) - at(0, 1, -1) + at(0, -1, -1)) * kCross;
      const auto offset = Offset({xx, xy, xs, yy, ys, ss}, slope);
      const auto [right, down, up] = offset;
      if (std::abs(right) < 0.5F && std::abs(down) < 0.5F && std::abs(up) < 0.5F) {
        const float value =
            centre * kGrey + 0.5F * (slope[0] * right + slope[1] * down + slope[2] * up);
        if (std::abs(value) * kLayers < contrast_) return {};
        const double trace = xx + yy;
        const double determinant = static_cast<double>(xx) * yy - static_cast<double>(xy) * xy;
        if (determinant <= 0 ||
            trace * trace * kEdgeRatio >= (kEdgeRatio + 1) * (kEdgeRatio + 1) * determinant) {
          return {};
        }
        return Placed(layer, x + left_, y, offset, std::abs(value));
      }
      constexpr float kFar = 1000;  // before the conversion to int
      if (!(std::max({std::abs(right), std::abs(down), std::abs(up)}) < kFar)) return {};
      x += static_cast<int>(std::lrint(right));
      y += static_cast<int>(std::lrint(down));
      layer += static_cast<int>(std::lrint(up));
      if (layer < 1 || layer > kLayers || std::abs(x - from_x) > kReach ||
          std::abs(y - from_y) > kReach || x + left_ < kBorder ||
          x + left_ >= base_.width - kBorder || y < kBorder || y >= base_.height - kBorder) {
        return {};
      }
    }
    return {};
  }

  // -M^-1 slope by Cramer's rule for the symmetric matrix with the upper triangle `m`, row by row;
  // zero where it has no inverse.
  static std::array<float, 3> Offset(const std::array<double, 6>& m,
                                     const std::array<float, 3>& slope) {
    const auto [xx, xy, xs, yy, ys, ss] = m;
    const std::array<double, 6> adjugate = {yy * ss - ys * ys, xs * ys - xy * ss,
                                            xy * ys - xs * yy, xx * ss - xs * xs,
                                            xy * xs - xx * ys, xx * yy - xy * xy};
    const double determinant = xx * adjugate[0] + xy * adjugate[1] + xs * adjugate[2];
    if (determinant == 0) return {};
    const auto row = [&](int a, int b, int c) {
      const auto at = [&](int i) { return adjugate[static_cast<std::size_t>(i)]; };
      return static_cast<float>(-(at(a) * slope[0] + at(b) * slope[1] + at(c) * slope[2]) /
                                determinant);
    };
    return {row(0, 1, 2), row(1, 3, 4), row(2, 4, 5)};
  }

  Candidate Placed(int layer, int x, int y, const std::array<float, 3>& offset,
                   float response) const {
    const auto [right, down, up] = offset;
    const float scale = std::ldexp(0.5F, octave_);  // the first octave is twice as large
    Candidate candidate{.keypoint = {}, .octave = octave_, .layer = layer, .x = x, .y = y};
    Keypoint& k = candidate.keypoint;
    k.x = (static_cast<float>(x) + right) * scale;
    k.y = (static_cast<float>(y) + down) * scale;
    k.size = static_cast<float>(kSigma * std::exp2((static_cast<float>(layer) + up) / kLayers)) *
             2 * scale;
    k.response = response;
    k.octave = ((octave_ - 1) & 255) | (layer << 8) |
               (static_cast<int>(std::lrint((up + 0.5F) * 255)) << 16);
    return candidate;
  }

  const Plane& base_;
  int octave_;
  double contrast_;
  Tile tile_;
  int left_ = 0, width_ = 0, stride_ = 0;  // of the rows, which have a margin around the tile
  std::array<Level, kLevels> levels_;      // without the first
  Floats scratch_;
  std::vector<std::int32_t> bits_;
};

std::vector<Tile> TilesOf(const Plane& plane, int threads) {
  constexpr int kMostRows = 1024;
  constexpr int kFewestRows = 128;  // of neighbours: some 50 rows are blurred twice
  const auto parts = [](int whole, int part) { return (whole + part - 1) / part; };
  const int columns = parts(plane.width, kColumnsOfATile);
  const int wanted = parts(2 * ResolveThreads(threads), columns);
  const int rows = std::clamp(wanted, parts(plane.height, kMostRows),
                              std::max(parts(plane.height, kMostRows), plane.height / kFewestRows));
  std::vector<Tile> tiles;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      tiles.push_back({plane.width * c / columns, plane.width * (c + 1) / columns,
                       plane.height * r / rows, plane.height * (r + 1) / rows});
    }
  }
  return tiles;
}

// Of an octave; fills the first level of the next one, if there is one.
std::vector<Candidate> FindInOctave(const Plane& first_level, int octave, double contrast,
                                    int threads, Plane* next) {
  const std::vector<Tile> tiles = TilesOf(first_level, threads);
  std::vector<std::vector<Candidate>> of_tiles(tiles.size());
  ParallelFor(tiles.size(), threads, [&](std::size_t i) {
    of_tiles[i] = TileSearch(first_level, octave, contrast, tiles[i]).Run(next);
  });
  std::vector<Candidate> all;
  for (const auto& found : of_tiles) all.insert(all.end(), found.begin(), found.end());
  return all;
}

// A square of a level around a pixel, inside the image, blurred from the first level.
struct Window {
  Window(const Plane& first_level, int level, int x, int y, int radius) {
    RowBlur probe(SigmaBetween(0, level), 1);
    const int margin = radius + probe.radius();
    left = std::max(0, x - margin);
    top = std::max(0, y - radius);
    const int right = std::min(first_level.width, x + margin + 1);
    const int bottom = std::min(first_level.height, y + radius + 1);
    values = Plane(right - left, bottom - top);
    RowBlur blur(SigmaBetween(0, level), values.width);
    blur.Run(
        top, bottom, first_level.height, [&](int row) { return first_level.row(row) + left; },
        [&](int row) { return values.row(row - top); });
  }

  float at(int x, int y) const { return values.row(y - top)[x - left]; }

  int left = 0, top = 0;
  Plane values;
};

// The dominant orientations of the gradient around a keypoint, in degrees (Lowe 2004, section 5).
std::vector<float> Orientations(const Plane& first_level, const Candidate& candidate) {
  const float sigma = candidate.keypoint.size * 0.5F / std::ldexp(0.5F, candidate.octave);
  const int radius = static_cast<int>(std::lrint(3 * kWindowSigma * sigma));
  const auto spread = static_cast<float>(kWindowSigma * sigma);
  const Window window(first_level, candidate.layer, candidate.x, candidate.y, radius + 1);
  const std::size_t most =
      static_cast<std::size_t>(2 * radius + 1) * static_cast<std::size_t>(2 * radius + 1);
  std::vector<float> dx;
  std::vector<float> dy;
  std::vector<float> weight;
  for (auto* values : {&dx, &dy, &weight}) values->reserve(most);
  for (int i = -radius; i <= radius; ++i) {
    const int y = candidate.y + i;
    if (y <= 0 || y >= first_level.height - 1) continue;
    for (int j = -radius; j <= radius; ++j) {
      const int x = candidate.x + j;
      if (x <= 0 || x >= first_level.width - 1) continue;
      dx.push_back(window.at(x + 1, y) - window.at(x - 1, y));
      dy.push_back(window.at(x, y - 1) - window.at(x, y + 1));
      weight.push_back(static_cast<float>(i * i + j * j) * (-0.5F / (spread * spread)));
    }
  }
  const int count = static_cast<int>(dx.size());
  std::vector<float> angle(dx.size());
  std::vector<float> length(dx.size());
  cv::hal::exp32f(weight.data(), weight.data(), count);
  cv::hal::fastAtan32f(dy.data(), dx.data(), angle.data(), count, /*angleInDegrees=*/true);
  cv::hal::magnitude32f(dx.data(), dy.data(), length.data(), count);

  std::array<float, kBins + 4> raw = {};  // two more on both sides
  for (std::size_t k = 0; k < angle.size(); ++k) {
    auto bin = static_cast<int>(std::lrint(angle[k] * (kBins / 360.0F)));
    if (bin >= kBins) bin -= kBins;
    raw[static_cast<std::size_t>(bin + 2)] += weight[k] * length[k];
  }
  raw[0] = raw[kBins];
  raw[1] = raw[kBins + 1];
  raw[kBins + 2] = raw[2];
  raw[kBins + 3] = raw[3];
  std::array<float, kBins> smooth{};
  for (std::size_t i = 0; i < kBins; ++i) {
    smooth[i] = (raw[i] + raw[i + 4]) * (1.0F / 16) + (raw[i + 1] + raw[i + 3]) * (4.0F / 16) +
                raw[i + 2] * (6.0F / 16);
  }
  const auto least = static_cast<float>(*std::max_element(smooth.begin(), smooth.end()) * kPeak);
  std::vector<float> angles;
  for (int i = 0; i < kBins; ++i) {
    const float left = smooth[static_cast<std::size_t>((i + kBins - 1) % kBins)];
    const float own = smooth[static_cast<std::size_t>(i)];
    const float right = smooth[static_cast<std::size_t>((i + 1) % kBins)];
    if (own <= left || own <= right || own < least) continue;
    float bin = static_cast<float>(i) + 0.5F * (left - right) / (left - 2 * own + right);
    if (bin < 0) bin += kBins;
    if (bin >= kBins) bin -= kBins;
    const float degrees = 360 - 360.0F / kBins * bin;
    angles.push_back(degrees >= 360 ? 0 : degrees);
  }
  std::sort(angles.begin(), angles.end());
  return angles;
}

auto Order(const Keypoint& k) { return std::tuple(-k.response, k.y, k.x, k.size, k.angle); }

bool SamePlace(const Candidate& a, const Candidate& b) {
  return a.keypoint.x == b.keypoint.x && a.keypoint.y == b.keypoint.y &&
         a.keypoint.size == b.keypoint.size;
}

void KeepStrongest(const KeypointOptions& options, std::vector<Candidate>* candidates) {
  if (options.inside) {
    std::erase_if(*candidates, [&](const Candidate& c) {
      return !Contains(*options.inside, c.keypoint.x, c.keypoint.y);
    });
  }
  std::sort(candidates->begin(), candidates->end(), [](const Candidate& a, const Candidate& b) {
    return Order(a.keypoint) < Order(b.keypoint);
  });
  // Two pixels may be refined to the same extremum.
  candidates->erase(std::unique(candidates->begin(), candidates->end(), SamePlace),
                    candidates->end());
  const auto most = static_cast<std::size_t>(options.max_keypoints);
  if (candidates->size() > most) candidates->resize(most);
}

}  // namespace

std::vector<Keypoint> Detect(const Image& grey, const KeypointOptions& options, double contrast,
                             int threads) {
  std::vector<Plane> first_levels;
  first_levels.push_back(FirstLevel(grey, threads));
  const int side = std::min(first_levels[0].width, first_levels[0].height);
  const int octaves = static_cast<int>(std::lround(std::log2(side) - 2)) + 1;
  std::vector<Candidate> candidates;
  for (int octave = 0; octave < octaves; ++octave) {
    const Plane& level = first_levels.back();
    Plane next;
    if (octave + 1 < octaves) next = Plane(level.width / 2, level.height / 2);
    const auto found =
        FindInOctave(level, octave, contrast, threads, octave + 1 < octaves ? &next : nullptr);
    candidates.insert(candidates.end(), found.begin(), found.end());
    first_levels.push_back(std::move(next));
  }
  KeepStrongest(options, &candidates);

  std::vector<std::vector<float>> angles(candidates.size());
  constexpr std::size_t kTogether = 32;
  ParallelFor((candidates.size() + kTogether - 1) / kTogether, threads, [&](std::size_t part) {
    const std::size_t end = std::min(candidates.size(), (part + 1) * kTogether);
    for (std::size_t i = part * kTogether; i < end; ++i) {
      const Candidate& c = candidates[i];
      angles[i] = Orientations(first_levels[static_cast<std::size_t>(c.octave)], c);
    }
  });
  std::vector<Keypoint> keypoints;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    for (const float angle : angles[i]) {
      if (keypoints.size() == static_cast<std::size_t>(options.max_keypoints)) return keypoints;
      keypoints.push_back(candidates[i].keypoint);
      keypoints.back().angle = angle;
      if (!options.keep_repeated_orientations) break;
    }
  }
  return keypoints;
}

}  // namespace pliant::sift
