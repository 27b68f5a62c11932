// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "descriptor/simulation/canvas.h"

namespace pliant::simulation {
namespace {

constexpr int kColumns = 320;

// One family of creases: ridges along the lines on which a stretched, turned noise is one half.
struct Creases {
  Noise noise;
  float cos, sin, along, across, width, height;

  explicit Creases(Random& random) : noise(random) {
    const float turn = random.Angle();
    cos = std::cos(turn);
    sin = std::sin(turn);
    across = random.LogUniform(4.0F, 18.0F);
    along = across * random.Uniform(0.2F, 0.8F);
    width = random.Uniform(0.04F, 0.16F);
    height = random.LogUniform(0.2F, 1.0F) / across;
  }
  float At(float x, float y) const {
    const float n = noise.At((cos * x + sin * y) * along, (cos * y - sin * x) * across, 2);
    const float t = (n - 0.5F) / width;
    return height * (std::exp(-t * t) + 0.6F * n);
  }
};

using Eigen::Vector3f;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

std::size_t Index(int columns, int column, int row) {
  return static_cast<std::size_t>(row) * columns + column;
}

// Catmull-Rom weights of the four neighbours at fraction t.
std::array<float, 4> CubicWeights(float t) {
  const float t2 = t * t;
  const float t3 = t2 * t;
  return {0.5F * (-t3 + 2.0F * t2 - t), 0.5F * (3.0F * t3 - 5.0F * t2 + 2.0F),
          0.5F * (-3.0F * t3 + 4.0F * t2 + t), 0.5F * (t3 - t2)};
}

// Refines one line of vertices. A missing neighbour is continued in a straight line; a span with a
// missing end stays NaN.
void RefineLine(const std::vector<Vector3f>& line, bool wraps, int factor,
                std::vector<Vector3f>& out) {
  const int count = static_cast<int>(line.size());
  const auto known = [&](int i) { return i >= 0 && i < count && line[i].allFinite(); };
  const auto at = [&](int i) { return line[i]; };
  out.assign(static_cast<std::size_t>((count - 1) * factor + 1), Vector3f::Constant(kNan));
  for (int i = 0; i + 1 < count; ++i) {
    if (!known(i) || !known(i + 1)) continue;
    const int before = wraps && i == 0 ? count - 2 : i - 1;
    const int after = wraps && i + 2 == count ? 1 : i + 2;
    const Vector3f p0 = known(before) ? at(before) : Vector3f(2.0F * at(i) - at(i + 1));
    const Vector3f p3 = known(after) ? at(after) : Vector3f(2.0F * at(i + 1) - at(i));
    for (int k = 0; k <= factor; ++k) {
      const auto w = CubicWeights(static_cast<float>(k) / factor);
      out[i * factor + k] = w[0] * p0 + w[1] * at(i) + w[2] * at(i + 1) + w[3] * p3;
    }
  }
}

void AddGridTriangles(Surface& surface, int columns, int rows) {
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      const int a = row * columns + column;
      const std::array corners{a, a + 1, a + columns, a + columns + 1};
      const auto missing = [&surface](int i) { return !surface.positions[i].allFinite(); };
      if (std::ranges::any_of(corners, missing)) continue;
      surface.triangles.push_back({corners[0], corners[1], corners[3]});
      surface.triangles.push_back({corners[0], corners[3], corners[2]});
    }
  }
}

void ComputeNormals(Surface& surface) {
  surface.normals.assign(surface.positions.size(), Vector3f::Zero());
  for (const auto& [a, b, c] : surface.triangles) {
    const Vector3f& p = surface.positions[a];
    const Vector3f normal = (surface.positions[c] - p).cross(surface.positions[b] - p);
    for (const int i : {a, b, c}) surface.normals[i] += normal;
  }
  for (Vector3f& normal : surface.normals) {
    const float length = normal.norm();
    normal = length > 1e-20F ? Vector3f(normal / length) : Vector3f(0.0F, 0.0F, -1.0F);
  }
}

// Ambient light at a vertex from the shape of the cloth around it: where the neighbours at a
// distance rise above the tangent plane the vertex lies in a valley and sees less.
void ComputeAmbient(Surface& surface, int columns, int rows, float cell) {
  surface.ambient.assign(surface.positions.size(), 1.0F);
  constexpr std::array<std::array<int, 2>, 8> kAround{
      {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}}};
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const std::size_t i = Index(columns, column, row);
      float hidden = 0.0F;
      for (const float reach : {0.03F, 0.08F}) {
        const int step = std::max(1, static_cast<int>(std::lround(reach / cell)));
        float rise = 0.0F;
        for (const auto& [dx, dy] : kAround) {
          const int x = std::clamp(column + dx * step, 0, columns - 1);
          const int y = std::clamp(row + dy * step, 0, rows - 1);
          const Vector3f offset = surface.positions[Index(columns, x, y)] - surface.positions[i];
          const float length = offset.norm();
          if (length > 1e-6F) rise += std::max(0.0F, surface.normals[i].dot(offset) / length);
        }
        hidden += rise / 8.0F;
      }
      if (std::isfinite(hidden)) surface.ambient[i] = std::clamp(1.0F - 0.9F * hidden, 0.25F, 1.0F);
    }
  }
}

// A surface over a grid of two parameters, each in [0, 1].
template <typename Function>
Surface MakeParametric(int columns, int rows, Function&& position) {
  Surface surface;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const float u = static_cast<float>(column) / (columns - 1);
      const float v = static_cast<float>(row) / (rows - 1);
      surface.positions.push_back(position(u, v));
      surface.uv.emplace_back(u, v);
    }
  }
  AddGridTriangles(surface, columns, rows);
  ComputeNormals(surface);
  surface.ambient.assign(surface.positions.size(), 1.0F);
  surface.closed = true;
  return surface;
}

// Fine where the cloth lies and its shadow falls, coarse towards the horizon.
Surface MakeTableSurface(const Solid& solid) {
  const auto stretch = [](float t) {
    const float x = 2.0F * t - 1.0F;
    return 1.3F * x + 7.0F * std::pow(x, 9.0F);
  };
  Surface surface = MakeParametric(90, 90, [&](float u, float v) {
    return Vector3f(solid.centre + solid.axes * Vector3f(stretch(u), stretch(v), 0.0F));
  });
  for (std::size_t i = 0; i < surface.uv.size(); ++i) {
    surface.uv[i] =
        Eigen::Array2f(stretch(surface.uv[i].x()), stretch(surface.uv[i].y())) / 3.0F + 0.5F;
  }
  surface.casts_shadow = false;
  return surface;
}

Surface MakeBoxSurface(const Solid& solid) {
  Surface box;
  box.closed = true;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0F, 1.0F}) {
      const Surface face = MakeParametric(9, 9, [&](float u, float v) {
        Vector3f local;
        local[axis] = side;
        // Turned so that the face's own normal points outwards.
        local[(axis + 1) % 3] = side * (1.0F - 2.0F * u);
        local[(axis + 2) % 3] = 2.0F * v - 1.0F;
        return Vector3f(solid.centre + solid.axes * solid.size.cwiseProduct(local));
      });
      const int base = static_cast<int>(box.positions.size());
      box.positions.insert(box.positions.end(), face.positions.begin(), face.positions.end());
      box.normals.insert(box.normals.end(), face.normals.begin(), face.normals.end());
      box.uv.insert(box.uv.end(), face.uv.begin(), face.uv.end());
      box.ambient.insert(box.ambient.end(), face.ambient.begin(), face.ambient.end());
      for (const auto& [a, b, c] : face.triangles)
        box.triangles.push_back({a + base, b + base, c + base});
    }
  }
  return box;
}

}  // namespace

Relief::Relief(Random& random, float aspect, float steepness) : columns_(kColumns) {
  rows_ = std::max(8, static_cast<int>(std::lround(aspect * kColumns)));
  std::vector<Creases> families;
  const int count = random.Integer(1, 3);
  for (int i = 0; i < count; ++i) families.emplace_back(random);
  const float step = 1.0F / columns_;
  std::vector<float> height;
  height.reserve(static_cast<std::size_t>(columns_ + 1) * (rows_ + 1));
  for (int y = 0; y <= rows_; ++y) {
    for (int x = 0; x <= columns_; ++x) {
      float sum = 0.0F;
      for (const Creases& family : families)
        sum += family.At(static_cast<float>(x) * step, static_cast<float>(y) * step);
      height.push_back(sum);
    }
  }
  double square = 0.0;
  slopes_.reserve(static_cast<std::size_t>(columns_) * rows_);
  for (int y = 0; y < rows_; ++y) {
    for (int x = 0; x < columns_; ++x) {
      const auto at = static_cast<std::size_t>(y * (columns_ + 1) + x);
      slopes_.emplace_back(height[at + 1] - height[at],
                           height[at + static_cast<std::size_t>(columns_) + 1] - height[at]);
      square += static_cast<double>(slopes_.back().square().sum());
    }
  }
  const double mean = std::sqrt(square / static_cast<double>(slopes_.size()));
  const float scale = steepness / static_cast<float>(std::max(mean, 1e-9));
  for (Eigen::Array2f& slope : slopes_) slope = (slope * scale).min(1.5F).max(-1.5F);
}

Eigen::Array2f Relief::Slope(float u, float v) const {
  return SampleGrid(slopes_, columns_, rows_, u * (columns_ - 1), v * (rows_ - 1));
}

RefinedChart Refine(const Chart& chart, const std::vector<Vector3f>& particles, int factor) {
  RefinedChart refined;
  refined.columns = (chart.columns - 1) * factor + 1;
  refined.rows = (chart.rows - 1) * factor + 1;
  std::vector<std::vector<Vector3f>> lines(static_cast<std::size_t>(chart.rows));
  std::vector<Vector3f> line;
  for (int row = 0; row < chart.rows; ++row) {
    line.clear();
    for (int column = 0; column < chart.columns; ++column) {
      const int particle = chart.At(column, row);
      line.push_back(particle < 0 ? Vector3f::Constant(kNan) : particles[particle]);
    }
    RefineLine(line, chart.wraps, factor, lines[row]);
  }
  refined.positions.resize(static_cast<std::size_t>(refined.columns) * refined.rows);
  std::vector<Vector3f> column_line(static_cast<std::size_t>(chart.rows));
  for (int column = 0; column < refined.columns; ++column) {
    for (int row = 0; row < chart.rows; ++row) {
      column_line[row] = lines[row][column];
    }
    RefineLine(column_line, false, factor, line);
    for (int row = 0; row < refined.rows; ++row) {
      refined.positions[Index(refined.columns, column, row)] = line[row];
    }
  }
  return refined;
}

Surface MakeChartSurface(const RefinedChart& chart, float cell) {
  Surface surface;
  surface.positions = chart.positions;
  surface.uv.reserve(chart.positions.size());
  for (int row = 0; row < chart.rows; ++row) {
    for (int column = 0; column < chart.columns; ++column) {
      surface.uv.emplace_back(static_cast<float>(column) / (chart.columns - 1),
                              static_cast<float>(row) / (chart.rows - 1));
    }
  }
  AddGridTriangles(surface, chart.columns, chart.rows);
  ComputeNormals(surface);
  ComputeAmbient(surface, chart.columns, chart.rows, cell);
  return surface;
}

Surface MakeSolidSurface(const Solid& solid) {
  switch (solid.kind) {
    case SolidKind::kTable:
      return MakeTableSurface(solid);
    case SolidKind::kBox:
      return MakeBoxSurface(solid);
    case SolidKind::kSphere:
      return MakeParametric(49, 25, [&](float u, float v) {
        const float around = 2.0F * kPi * u;
        const float down = kPi * v;
        const Vector3f local(std::sin(down) * std::cos(around), -std::cos(down),
                             std::sin(down) * std::sin(around));
        return Vector3f(solid.centre + solid.axes * (solid.size.x() * local));
      });
    case SolidKind::kCylinder:
      break;
  }
  // Side and caps in one: the first and last rows close towards the axis.
  return MakeParametric(49, 13, [&](float u, float v) {
    const float around = 2.0F * kPi * u;
    const float y = std::clamp((v - 0.1F) / 0.8F, 0.0F, 1.0F) * 2.0F - 1.0F;
    const float radius = solid.size.x() * std::min(1.0F, std::min(v, 1.0F - v) / 0.0833F);
    return Vector3f(solid.centre + solid.axes * Vector3f(radius * std::cos(around),
                                                         y * solid.size.y(),
                                                         radius * std::sin(around)));
  });
}

}  // namespace pliant::simulation
