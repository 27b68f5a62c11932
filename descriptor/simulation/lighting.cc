// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/lighting.h"

#include <algorithm>
#include <cmath>

namespace pliant::simulation {
namespace {

using Eigen::Vector3f;

constexpr int kShadowMapSize = 320;
constexpr float kShadowRadius = 1.1F;  // the part of the scene that is mapped, around its centre

Colour DrawTint(Random& random, float amount) {
  Colour tint(1.0F + amount * random.Normal(), 1.0F, 1.0F + amount * random.Normal(), 0.0F);
  return tint.max(0.3F).min(2.0F);
}

Vector3f CentreOfCasters(const std::vector<Surface>& surfaces) {
  Vector3f sum = Vector3f::Zero();
  float count = 0.0F;
  for (const Surface& surface : surfaces) {
    if (!surface.casts_shadow) continue;
    for (const Vector3f& position : surface.positions) {
      if (!position.allFinite()) continue;
      sum += position;
      count += 1.0F;
    }
  }
  return count > 0.0F ? Vector3f(sum / count) : sum;
}

}  // namespace

Lighting DrawLighting(Random& random, const Vector3f& view) {
  Lighting lighting;
  const int count = random.Integer(1, 4);
  const float overall = random.LogUniform(0.75F, 1.3F);
  float share = random.Uniform(0.5F, 0.9F);
  for (int i = 0; i < count; ++i) {
    Light light;
    // On the camera's side, up to grazing angles.
    Vector3f direction = random.Direction();
    if (direction.dot(view) < 0.0F) direction = -direction;
    direction = (direction + view * random.Uniform(0.1F, 0.9F)).normalized();
    light.near = random.Chance(0.35F);
    light.position = direction * (light.near ? random.Uniform(0.9F, 2.5F) : 6.0F);
    light.colour = share * overall * DrawTint(random, i == 0 ? 0.08F : 0.25F);
    light.casts_shadow = i < 2;
    light.softness = random.LogUniform(0.006F, 0.06F);
    lighting.lights.push_back(light);
    share *= random.Uniform(0.2F, 0.6F);
  }
  lighting.ambient = overall * random.Uniform(0.15F, 0.5F) * DrawTint(random, 0.06F);
  lighting.sky = (view + 0.8F * random.Direction()).normalized();
  return lighting;
}

ShadowMap::ShadowMap(const Light& light, const std::vector<Surface>& surfaces)
    : centre_(CentreOfCasters(surfaces)), depth_(kShadowMapSize, kShadowMapSize) {
  const Vector3f along = -light.position.normalized();
  const Vector3f helper = std::abs(along.x()) < 0.8F ? Vector3f::UnitX() : Vector3f::UnitY();
  axes_.row(2) = along;
  axes_.row(0) = helper.cross(along).normalized();
  axes_.row(1) = along.cross(axes_.row(0).transpose());
  scale_ = 0.5F * static_cast<float>(kShadowMapSize) / kShadowRadius;
  spread_ = light.softness * scale_;
  std::vector<Eigen::Array2f> corner;
  std::vector<float> near;
  for (const Surface& surface : surfaces) {
    if (!surface.casts_shadow) continue;
    corner.clear();
    near.clear();
    for (const Vector3f& position : surface.positions) {
      corner.push_back(ToMap(position));
      near.push_back(-axes_.row(2).dot(position - centre_));
    }
    for (const auto& [a, b, c] : surface.triangles) {
      const auto i = static_cast<std::size_t>(a);
      const auto j = static_cast<std::size_t>(b);
      const auto k = static_cast<std::size_t>(c);
      const auto keep = [&](int, int) { return true; };
      depth_.Draw({corner[i], corner[j], corner[k]}, {near[i], near[j], near[k]}, 0, keep);
    }
  }
}

Eigen::Array2f ShadowMap::ToMap(const Vector3f& point) const {
  const Vector3f local = axes_ * (point - centre_);
  return local.head<2>().array() * scale_ + 0.5F * static_cast<float>(kShadowMapSize);
}

float ShadowMap::Visible(const Vector3f& point) const {
  const Eigen::Array2f at = ToMap(point);
  const float near = -axes_.row(2).dot(point - centre_) + 0.012F + 0.5F * spread_ / scale_;
  int lit = 0;
  constexpr int kTaps = 4;
  for (int j = 0; j < kTaps; ++j) {
    for (int i = 0; i < kTaps; ++i) {
      const float dx = (2.0F * static_cast<float>(i) / (kTaps - 1) - 1.0F) * spread_;
      const float dy = (2.0F * static_cast<float>(j) / (kTaps - 1) - 1.0F) * spread_;
      const int x = static_cast<int>(std::floor(at.x() + dx + 0.5F));
      const int y = static_cast<int>(std::floor(at.y() + dy + 0.5F));
      if (x < 0 || y < 0 || x >= depth_.width() || y >= depth_.height() ||
          depth_.nearness(x, y) <= near)
        ++lit;
    }
  }
  return static_cast<float>(lit) / (kTaps * kTaps);
}

std::vector<ShadowMap> MakeShadowMaps(const Lighting& lighting,
                                      const std::vector<Surface>& surfaces) {
  std::vector<ShadowMap> maps;
  for (const Light& light : lighting.lights) {
    if (light.casts_shadow) maps.emplace_back(light, surfaces);
  }
  return maps;
}

VertexLight LightVertices(const Surface& surface, const Lighting& lighting,
                          const std::vector<ShadowMap>& shadows, const Vector3f& eye) {
  VertexLight out;
  const std::size_t count = surface.positions.size();
  out.front.resize(count);
  out.back.resize(count);
  out.gloss.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3f& position = surface.positions[i];
    if (!position.allFinite()) continue;
    const Vector3f& normal = surface.normals[i];
    const float up = normal.dot(lighting.sky);
    const float ambient = surface.ambient[i];
    Colour front = lighting.ambient * (ambient * (0.75F + 0.25F * up));
    Colour back = lighting.ambient * (ambient * (0.75F - 0.25F * up));
    Colour gloss = Colour::Zero();
    const Vector3f to_eye = (eye - position).normalized();
    std::size_t map = 0;
    for (const Light& light : lighting.lights) {
      const Vector3f offset = light.near ? Vector3f(light.position - position) : light.position;
      const float distance = offset.norm();
      const Vector3f direction = offset / distance;
      float strength = 1.0F;
      if (light.near) {
        const float relative = light.position.norm() / std::max(0.3F, distance);
        strength = relative * relative;
      }
      const float facing = normal.dot(direction);
      if (light.casts_shadow) {
        // Lifted off the surface on the lit side, so that it does not shade itself.
        const Vector3f lifted = position + normal * std::copysign(0.012F, facing);
        strength *= shadows[map++].Visible(lifted);
      }
      if (strength <= 0.0F) continue;
      const Colour arriving = light.colour * strength;
      // A thin cloth lets a little light through.
      front += arriving * (facing > 0.0F ? facing : -0.12F * facing);
      back += arriving * (facing < 0.0F ? -facing : 0.12F * facing);
      if (surface.material.gloss > 0.0F && facing > 0.0F) {
        const float peak = std::max(0.0F, normal.dot((direction + to_eye).normalized()));
        gloss +=
            arriving * (surface.material.gloss * std::pow(peak, surface.material.gloss_exponent));
      }
    }
    out.front[i] = front;
    out.back[i] = back;
    out.gloss[i] = gloss;
  }
  return out;
}

}  // namespace pliant::simulation
