// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace pliant::simulation {
namespace {

Chart MakeGrid(float aspect, int cells) {
  Chart chart;
  chart.width = std::min(1.0F, 1.0F / aspect);
  chart.height = std::min(1.0F, aspect);
  const auto count = [cells](float length) {
    return std::max(4, static_cast<int>(std::lround(length * cells))) + 1;
  };
  chart.columns = count(chart.width);
  chart.rows = count(chart.height);
  chart.particle.assign(static_cast<std::size_t>(chart.columns) * chart.rows, -1);
  return chart;
}

Eigen::Vector3f FlatPosition(const Chart& chart, int column, int row) {
  const float u = static_cast<float>(column) / (chart.columns - 1);
  const float v = static_cast<float>(row) / (chart.rows - 1);
  return {(u - 0.5F) * chart.width, (v - 0.5F) * chart.height, 0.0F};
}

// Adds the edges of one chart in one direction, in passes over even and odd vertices so that
// successive constraints are independent and the processor can overlap them.
void AddEdges(const Chart& chart, int step_x, int step_y, std::vector<Edge>& edges) {
  const float cell_x = chart.width / static_cast<float>(chart.columns - 1);
  const float cell_y = chart.height / static_cast<float>(chart.rows - 1);
  const float rest = std::hypot(cell_x * step_x, cell_y * step_y);
  const int period = chart.columns - 1;
  for (int pass = 0; pass < 2; ++pass) {
    for (int row = 0; row < chart.rows; ++row) {
      for (int column = 0; column < chart.columns; ++column) {
        const int phase = step_x == 0 ? row / step_y : column / std::abs(step_x);
        if (phase % 2 != pass) continue;
        int other = column + step_x;
        const int below = row + step_y;
        if (below >= chart.rows) continue;
        if (chart.wraps) {
          if (column == period) continue;  // the same particles as column 0
          other = (other + period) % period;
        } else if (other < 0 || other >= chart.columns) {
          continue;
        }
        const int a = chart.At(column, row);
        const int b = chart.At(other, below);
        if (a >= 0 && b >= 0) edges.push_back({a, b, rest});
      }
    }
  }
}

// Edges that two welded charts both have would be solved twice; keep the first.
void DropRepeats(std::vector<Edge>& edges, std::size_t particles) {
  std::vector<std::vector<int>> seen(particles);
  std::erase_if(edges, [&](const Edge& edge) {
    const auto [low, high] = std::minmax(edge.a, edge.b);
    auto& partners = seen[low];
    if (std::ranges::find(partners, high) != partners.end()) return true;
    partners.push_back(high);
    return false;
  });
}

void BuildConstraints(Body& body) {
  for (const Chart& chart : body.charts) {
    AddEdges(chart, 1, 0, body.structural);
    AddEdges(chart, 0, 1, body.structural);
    AddEdges(chart, 1, 1, body.shear);
    AddEdges(chart, -1, 1, body.shear);
    AddEdges(chart, 2, 0, body.bending);
    AddEdges(chart, 0, 2, body.bending);
  }
  DropRepeats(body.structural, body.rest.size());
  DropRepeats(body.shear, body.rest.size());
  DropRepeats(body.bending, body.rest.size());
  float sum = 0.0F;
  for (const Edge& edge : body.structural) sum += edge.rest;
  body.spacing = sum / std::max<std::size_t>(1, body.structural.size());
}

int AddParticle(Body& body, const Eigen::Vector3f& position) {
  body.rest.push_back(position);
  return static_cast<int>(body.rest.size()) - 1;
}

// One side of the shirt's outline, for x >= 0 measured from the middle line, in chart units of
// half the width; y downwards in [0, 1].
struct ShirtCut {
  float neck_half, neck_depth, shoulder_drop, armpit_y, sleeve_end, body_half, hem_half;

  bool Contains(float x, float y) const {
    x = std::abs(x);
    if (x < neck_half && y < neck_depth * std::sqrt(1.0F - (x / neck_half) * (x / neck_half)))
      return false;
    const float slope = std::max(0.0F, x - neck_half) / (1.0F - neck_half);
    if (y < slope * shoulder_drop) return false;
    const float side = body_half + (hem_half - body_half) * (y - armpit_y) / (1.0F - armpit_y);
    if (y >= armpit_y) return x <= side;
    const float under_arm =
        armpit_y + (sleeve_end - armpit_y) * (x - body_half) / (1.0F - body_half);
    return x <= body_half || y <= under_arm;
  }
};

Outline MakeShirtOutline(Random& random) {
  ShirtCut cut{};
  cut.neck_half = random.Uniform(0.18F, 0.28F);
  cut.neck_depth = random.Uniform(0.05F, 0.14F);
  cut.shoulder_drop = random.Uniform(0.12F, 0.28F);
  cut.armpit_y = random.Uniform(0.32F, 0.42F);
  cut.sleeve_end = cut.armpit_y + random.Uniform(0.0F, 0.12F);
  cut.body_half = random.Uniform(0.55F, 0.68F);
  cut.hem_half = cut.body_half * random.Uniform(0.97F, 1.1F);
  Outline outline;
  outline.size = 512;
  outline.inside.resize(static_cast<std::size_t>(outline.size) * outline.size);
  for (int y = 0; y < outline.size; ++y) {
    for (int x = 0; x < outline.size; ++x) {
      const float u = (x + 0.5F) / static_cast<float>(outline.size);
      const float v = (y + 0.5F) / static_cast<float>(outline.size);
      outline.inside[static_cast<std::size_t>(y) * outline.size + x] =
          cut.Contains(2.0F * u - 1.0F, v) ? 1 : 0;
    }
  }
  return outline;
}

// A vertex carries cloth when the outline reaches into one of the cells around it.
bool CellTouches(const Chart& chart, int column, int row) {
  const float step_u = 1.0F / (chart.columns - 1);
  const float step_v = 1.0F / (chart.rows - 1);
  for (int dy = -2; dy <= 2; ++dy) {
    for (int dx = -2; dx <= 2; ++dx) {
      const float u = (column + 0.45F * dx) * step_u;
      const float v = (row + 0.45F * dy) * step_v;
      if (chart.outline.Contains(u, v)) return true;
    }
  }
  return false;
}

// Adds a front and a back, joined where `sewn`, else `apart` cells before and behind the middle.
template <typename Occupied, typename Sewn>
void SewTwoSides(Body& body, Chart& front, float apart, Occupied&& occupied, Sewn&& sewn) {
  Chart back = front;
  const Eigen::Vector3f thin(0.0F, 0.0F, apart * front.width / (front.columns - 1));
  for (int row = 0; row < front.rows; ++row) {
    for (int column = 0; column < front.columns; ++column) {
      if (!occupied(column, row)) continue;
      const int at = row * front.columns + column;
      // Seen from behind, u runs the other way.
      const int mirrored = row * front.columns + front.columns - 1 - column;
      const bool joined = sewn(column, row);
      const Eigen::Vector3f position = FlatPosition(front, column, row);
      front.particle[at] = AddParticle(body, joined ? position : Eigen::Vector3f(position - thin));
      back.particle[mirrored] = joined ? front.particle[at] : AddParticle(body, position + thin);
    }
  }
  body.charts = {std::move(front), std::move(back)};
  BuildConstraints(body);
}

}  // namespace

bool Outline::Contains(float u, float v) const {
  if (u < 0.0F || v < 0.0F || u > 1.0F || v > 1.0F) return false;
  if (empty()) return true;
  const int x = std::min(size - 1, static_cast<int>(u * size));
  const int y = std::min(size - 1, static_cast<int>(v * size));
  return inside[static_cast<std::size_t>(y) * size + x] != 0;
}

std::string ToString(BodyKind kind) {
  constexpr std::array kNames{"sheet", "tube", "pillow", "shirt"};
  return kNames[static_cast<std::size_t>(kind)];
}

Body MakeSheet(float aspect, int cells) {
  Body body;
  Chart chart = MakeGrid(aspect, cells);
  for (int row = 0; row < chart.rows; ++row) {
    for (int column = 0; column < chart.columns; ++column) {
      chart.particle[row * chart.columns + column] =
          AddParticle(body, FlatPosition(chart, column, row));
    }
  }
  body.charts.push_back(std::move(chart));
  BuildConstraints(body);
  return body;
}

Body MakeTube(float aspect, int cells) {
  Body body;
  body.kind = BodyKind::kTube;
  Chart chart = MakeGrid(aspect, cells);
  chart.wraps = true;
  // The chord between neighbours, not the arc, is their rest length.
  const int period = chart.columns - 1;
  const float chord = chart.width / static_cast<float>(period);
  const float radius = 0.5F * chord / std::sin(kPi / period);
  for (int row = 0; row < chart.rows; ++row) {
    for (int column = 0; column < chart.columns; ++column) {
      int& particle = chart.particle[row * chart.columns + column];
      if (column == period) {
        particle = chart.At(0, row);
        continue;
      }
      // u = 0.5 faces the camera at -z; x grows with u.
      const float turn = 2.0F * kPi * (static_cast<float>(column) / period - 0.5F);
      const float y = FlatPosition(chart, column, row).y();
      particle = AddParticle(body, {radius * std::sin(turn), y, -radius * std::cos(turn)});
    }
  }
  body.charts.push_back(std::move(chart));
  BuildConstraints(body);
  return body;
}

Body MakePillow(float aspect, int cells) {
  Body body;
  body.kind = BodyKind::kPillow;
  Chart front = MakeGrid(aspect, cells);
  const auto sewn = [&front](int column, int row) {
    return row == 0 || column == 0 || row == front.rows - 1 || column == front.columns - 1;
  };
  SewTwoSides(body, front, 0.15F, [](int, int) { return true; }, sewn);
  return body;
}

Body MakeShirt(float aspect, int cells, Random& random) {
  Body body;
  body.kind = BodyKind::kShirt;
  Chart front = MakeGrid(aspect, cells);
  front.outline = MakeShirtOutline(random);
  const auto occupied = [&front](int column, int row) {
    return column >= 0 && row >= 0 && column < front.columns && row < front.rows &&
           CellTouches(front, column, row);
  };
  // Sewn along the sides and the shoulders; open at the hem, at the neck and at the cuffs.
  const auto sewn = [&](int column, int row) {
    const bool side =
        row < front.rows - 1 && (!occupied(column - 1, row) || !occupied(column + 1, row));
    const bool neck = std::abs(static_cast<float>(column) / (front.columns - 1) - 0.5F) < 0.16F;
    const bool cuff = column == 0 || column == front.columns - 1;
    const bool shoulder = !neck && !occupied(column, row - 1);
    return (side && !cuff && !neck) || shoulder;
  };
  // The outline is symmetric, so the back's chart may keep it although its u is mirrored.
  SewTwoSides(body, front, 0.25F, occupied, sewn);
  return body;
}

float StretchQuantile(const Body& body, const std::vector<Eigen::Vector3f>& positions,
                      float quantile) {
  std::vector<float> stretch;
  stretch.reserve(body.structural.size());
  for (const Edge& edge : body.structural) {
    const float length = (positions[edge.b] - positions[edge.a]).norm();
    stretch.push_back(std::abs(length / edge.rest - 1.0F));
  }
  if (stretch.empty()) return 0.0F;
  const auto at = static_cast<std::ptrdiff_t>(quantile * (stretch.size() - 1));
  std::nth_element(stretch.begin(), stretch.begin() + at, stretch.end());
  return stretch[at];
}

}  // namespace pliant::simulation
