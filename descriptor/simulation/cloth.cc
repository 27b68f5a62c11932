// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/cloth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "descriptor/base/error.h"

namespace pliant::simulation {
namespace {

using Eigen::Vector3f;
using Eigen::Vector4f;

// Box with half sides `size`, rounded a little so that cloth gets a usable normal at its edges.
float BoxDistance(const Vector3f& p, const Vector3f& size, Vector3f& normal) {
  const Vector3f q = p.cwiseAbs() - size;
  if (q.maxCoeff() <= 0.0F) {
    int axis = 0;
    const float distance = q.maxCoeff(&axis);
    normal = Vector3f::Zero();
    normal[axis] = p[axis] < 0.0F ? -1.0F : 1.0F;
    return distance;
  }
  const Vector3f outside = q.cwiseMax(0.0F);
  const float distance = outside.norm();
  for (int i = 0; i < 3; ++i) normal[i] = std::copysign(outside[i] / distance, p[i]);
  return distance;
}

float CylinderDistance(const Vector3f& p, float radius, float half_length, Vector3f& normal) {
  const float across = std::hypot(p.x(), p.z());
  const float side = across - radius;
  const float cap = std::abs(p.y()) - half_length;
  const Vector3f outward =
      across > 1e-6F ? Vector3f(p.x() / across, 0.0F, p.z() / across) : Vector3f(1, 0, 0);
  const Vector3f along(0.0F, p.y() < 0.0F ? -1.0F : 1.0F, 0.0F);
  if (side > 0.0F && cap > 0.0F) {
    const float distance = std::hypot(side, cap);
    normal = (outward * side + along * cap) / distance;
    return distance;
  }
  normal = side > cap ? outward : along;
  return std::max(side, cap);
}

constexpr float kFrame = 1.0F / 60.0F;
constexpr float kMaxSpeed = 12.0F;  // units / s; keeps a bad collision from throwing cloth away

std::size_t At(int index) { return static_cast<std::size_t>(index); }

Vector3f In3(const Vector4f& v) { return v.head<3>(); }
Vector4f In4(const Vector3f& v) { return {v.x(), v.y(), v.z(), 0.0F}; }

}  // namespace

float Solid::Distance(const Vector3f& point, Vector3f& normal) const {
  const Vector3f offset = point - centre;
  if (kind == SolidKind::kSphere) {
    const float norm = offset.norm();
    normal = norm > 1e-6F ? Vector3f(offset / norm) : Vector3f(0.0F, 0.0F, -1.0F);
    return norm - size.x();
  }
  if (kind == SolidKind::kTable) {
    normal = -axes.col(2);
    return normal.dot(offset);
  }
  const Vector3f local = axes.transpose() * offset;
  Vector3f local_normal;
  const float distance = kind == SolidKind::kBox
                             ? BoxDistance(local, size, local_normal)
                             : CylinderDistance(local, size.x(), size.y(), local_normal);
  normal = axes * local_normal;
  return distance;
}

Wind::Wind(Random& random, float strength) : strength_(strength) {
  steady_ = random.Direction() * random.Uniform(0.2F, 1.0F);
  for (Wave& wave : waves_) {
    wave.direction = random.Direction();
    wave.wave_vector = random.Direction() * random.Uniform(2.0F, 14.0F);
    wave.frequency = random.Uniform(1.0F, 12.0F);
    wave.phase = random.Angle();
  }
}

Vector3f Wind::At(const Vector3f& position, float time) const {
  Vector3f velocity = steady_;
  for (const Wave& wave : waves_) {
    velocity += wave.direction *
                std::sin(wave.wave_vector.dot(position) + wave.frequency * time + wave.phase);
  }
  return strength_ * velocity;
}

Cloth::Cloth(const Body& body, const std::vector<Vector3f>& start, ClothOptions options)
    : body_(body), options_(std::move(options)) {
  const std::size_t count = start.size();
  for (const Vector3f& position : start) positions_.push_back(In4(position));
  previous_ = positions_;
  velocities_.assign(count, Vector4f::Zero());
  normals_.assign(count, Vector3f(0.0F, 0.0F, -1.0F));
  air_.assign(count, Vector3f::Zero());
  inverse_mass_.assign(count, 1.0F);
  for (const Pin& pin : options_.pins) inverse_mass_[At(pin.particle)] = 0.0F;
  contact_distance_ = 0.75F * body.spacing;
  BuildAttachments();
}

// A particle can never be farther from a pin than it is on the flat cloth. For tubes, pillows and
// shirts the shortest way over the cloth is not a straight line, so they do without.
void Cloth::BuildAttachments() {
  if (body_.kind != BodyKind::kSheet) return;
  for (std::size_t i = 0; i < positions_.size(); ++i) {
    if (inverse_mass_[i] == 0.0F) continue;
    for (const Pin& pin : options_.pins) {
      if (pin.release) continue;
      attachments_.push_back({pin.particle, static_cast<int>(i),
                              (body_.rest[i] - body_.rest[At(pin.particle)]).norm()});
    }
  }
}

void Cloth::UpdateNormals() {
  std::ranges::fill(normals_, Vector3f::Zero());
  for (const Chart& chart : body_.charts) {
    for (int row = 0; row + 1 < chart.rows; ++row) {
      for (int column = 0; column + 1 < chart.columns; ++column) {
        const std::array corners{chart.At(column, row), chart.At(column + 1, row),
                                 chart.At(column, row + 1), chart.At(column + 1, row + 1)};
        if (std::ranges::min(corners) < 0) continue;
        const Vector3f across = In3(positions_[At(corners[3])] - positions_[At(corners[0])]);
        const Vector3f down = In3(positions_[At(corners[2])] - positions_[At(corners[1])]);
        const Vector3f normal = down.cross(across);
        for (const int corner : corners) normals_[At(corner)] += normal;
      }
    }
  }
  for (Vector3f& normal : normals_) normal.normalize();
}

void Cloth::UpdateAir() {
  for (std::size_t i = 0; i < positions_.size(); ++i) {
    air_[i] = options_.wind.At(In3(positions_[i]), time_s_);
  }
}

void Cloth::Run(int frames) {
  for (int frame = 0; frame < frames; ++frame) {
    UpdateNormals();
    UpdateAir();
    if (options_.self_collision) FindContacts();
    const float dt = kFrame / static_cast<float>(options_.substeps);
    for (int i = 0; i < options_.substeps; ++i) Substep(dt);
  }
  for (const Vector4f& position : positions_) {
    if (!position.allFinite()) {
      throw Error(ErrorCode::kInternal, "simulation_diverged", "the cloth simulation diverged");
    }
  }
}

void Cloth::MovePins(float dt) {
  for (const Pin& pin : options_.pins) {
    if (time_s_ < pin.until_s) {
      positions_[At(pin.particle)] += In4(pin.velocity) * dt;
    } else if (pin.release) {
      inverse_mass_[At(pin.particle)] = 1.0F;
    }
  }
}

void Cloth::Substep(float dt) {
  previous_ = positions_;
  MovePins(dt);
  const float keep = std::exp(-options_.damping * dt);
  for (std::size_t i = 0; i < positions_.size(); ++i) {
    if (inverse_mass_[i] == 0.0F) continue;
    const float blow = normals_[i].dot(air_[i] - In3(velocities_[i]));
    const Vector3f push = normals_[i] * (options_.drag * blow + options_.pressure);
    velocities_[i] = (velocities_[i] + In4(options_.gravity + push) * dt) * keep;
    const float speed = velocities_[i].norm();
    if (speed > kMaxSpeed) velocities_[i] *= kMaxSpeed / speed;
    positions_[i] += velocities_[i] * dt;
  }
  const float per_step = 1.0F / (dt * dt);
  SolveEdges(body_.bending, options_.bend_compliance * per_step);
  SolveEdges(body_.shear, options_.shear_compliance * per_step);
  SolveEdges(body_.structural, 0.0F);
  SolveAttachments();
  SolveEdges(body_.structural, 0.0F);
  SolveContacts();
  SolveSolids();
  for (std::size_t i = 0; i < positions_.size(); ++i) {
    velocities_[i] = (positions_[i] - previous_[i]) / dt;
  }
  time_s_ += dt;
}

// C = |b - a| - rest; with one iteration a step the multiplier starts at zero (XPBD, eq. 18).
void Cloth::SolveEdges(const std::vector<Edge>& edges, float alpha) {
  for (const Edge& edge : edges) {
    const float mass_a = inverse_mass_[At(edge.a)];
    const float mass_b = inverse_mass_[At(edge.b)];
    Vector4f& a = positions_[At(edge.a)];
    Vector4f& b = positions_[At(edge.b)];
    const Vector4f d = b - a;
    const float length = std::sqrt(d.squaredNorm()) + 1e-9F;
    const float scale = (length - edge.rest) / (length * (mass_a + mass_b + alpha + 1e-9F));
    a += d * (scale * mass_a);
    b -= d * (scale * mass_b);
  }
}

void Cloth::SolveAttachments() {
  for (const Attachment& attachment : attachments_) {
    Vector4f& position = positions_[At(attachment.particle)];
    const Vector4f offset = position - positions_[At(attachment.pin)];
    const float squared = offset.squaredNorm();
    if (squared <= attachment.reach * attachment.reach) continue;
    position -= offset * (1.0F - attachment.reach / std::sqrt(squared));
  }
}

// Pairs of particles that are close in space but not on the cloth, through a hashed uniform grid:
// particles sorted by bucket, buckets found by their first entry.
void Cloth::FindContacts() {
  contacts_.clear();
  constexpr std::uint32_t kBuckets = 1U << 13U;
  const float cell = 1.5F * contact_distance_;
  const auto bucket = [](const Eigen::Vector3i& at) {
    return ((static_cast<std::uint32_t>(at.x()) * 73856093U) ^
            (static_cast<std::uint32_t>(at.y()) * 19349663U) ^
            (static_cast<std::uint32_t>(at.z()) * 83492791U)) %
           kBuckets;
  };
  const auto cell_of = [cell](const Vector4f& position) -> Eigen::Vector3i {
    return (position.head<3>() / cell).array().floor().cast<int>();
  };
  std::vector<int> first(kBuckets + 1, 0);
  for (const Vector4f& position : positions_) ++first[bucket(cell_of(position)) + 1];
  for (std::size_t i = 0; i < kBuckets; ++i) first[i + 1] += first[i];
  std::vector<int> members(positions_.size());
  std::vector<int> filled = first;
  for (std::size_t i = 0; i < positions_.size(); ++i) {
    members[At(filled[bucket(cell_of(positions_[i]))]++)] = static_cast<int>(i);
  }
  const float apart_on_cloth = 2.5F * body_.spacing;
  for (std::size_t a = 0; a < positions_.size(); ++a) {
    const Eigen::Vector3i own = cell_of(positions_[a]);
    for (int neighbour = 0; neighbour < 27; ++neighbour) {
      const Eigen::Vector3i step(neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1);
      const std::uint32_t there = bucket(own + step);
      for (int k = first[there]; k < first[there + 1]; ++k) {
        const std::size_t b = At(members[At(k)]);
        if (b <= a || (positions_[b] - positions_[a]).squaredNorm() > cell * cell) continue;
        if ((body_.rest[b] - body_.rest[a]).squaredNorm() < apart_on_cloth * apart_on_cloth)
          continue;
        if (cell_of(positions_[b]) != own + step) continue;  // another cell of the same bucket
        contacts_.push_back({static_cast<int>(a), static_cast<int>(b)});
      }
    }
  }
}

void Cloth::SolveContacts() {
  for (const Contact& contact : contacts_) {
    const float mass_a = inverse_mass_[At(contact.a)];
    const float mass_b = inverse_mass_[At(contact.b)];
    Vector4f& a = positions_[At(contact.a)];
    Vector4f& b = positions_[At(contact.b)];
    const Vector4f d = b - a;
    const float squared = d.squaredNorm();
    if (squared >= contact_distance_ * contact_distance_ || mass_a + mass_b == 0.0F) continue;
    const float length = std::sqrt(squared) + 1e-9F;
    // Half of the correction a step: contacts must not fight the edges.
    const float scale = 0.5F * (length - contact_distance_) / (length * (mass_a + mass_b));
    a += d * (scale * mass_a);
    b -= d * (scale * mass_b);
  }
}

// Pushes particles out and takes the tangential motion away up to Coulomb's limit.
void Cloth::SolveSolids() {
  for (const Solid& solid : options_.solids) {
    for (std::size_t i = 0; i < positions_.size(); ++i) {
      if (inverse_mass_[i] == 0.0F) continue;
      Vector3f normal;
      const float depth = options_.thickness - solid.Distance(In3(positions_[i]), normal);
      if (depth <= 0.0F) continue;
      positions_[i] += In4(normal * depth);
      const Vector3f moved = In3(positions_[i] - previous_[i]);
      const Vector3f slide = moved - normal * normal.dot(moved);
      const float length = slide.norm();
      if (length < 1e-9F) continue;
      positions_[i] -= In4(slide * std::min(1.0F, solid.friction * depth / length));
    }
  }
}

std::vector<Vector3f> Cloth::positions() const {
  std::vector<Vector3f> out;
  out.reserve(positions_.size());
  for (const Vector4f& position : positions_) out.push_back(In3(position));
  return out;
}

void Cloth::Relax(float target, int max_passes) {
  std::ranges::fill(inverse_mass_, 1.0F);
  for (int pass = 0; pass < max_passes; ++pass) {
    if (pass % 5 == 0 && StretchQuantile(body_, positions(), 0.95F) <= target) return;
    SolveEdges(body_.structural, 0.0F);
  }
}

}  // namespace pliant::simulation
