// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace pliant::simulation {
namespace {

using Eigen::Array2f;
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

// How a value that is linear over a triangle grows along x and y (Cramer's rule): `d1` and `d2` are
// its differences along the edges from the first corner, `area` is twice the triangle's, with its
// sign.
template <typename Value>
std::pair<Value, Value> Slopes(const std::array<Array2f, 3>& at, const Value& d1, const Value& d2,
                               float area) {
  const Array2f e1 = at[1] - at[0];
  const Array2f e2 = at[2] - at[0];
  return {(d1 * e2.y() - d2 * e1.y()) / area, (d2 * e1.x() - d1 * e2.x()) / area};
}

float SignedArea(const std::array<Array2f, 3>& at) {
  const Array2f e1 = at[1] - at[0];
  const Array2f e2 = at[2] - at[0];
  return e1.x() * e2.y() - e2.x() * e1.y();
}

// A z-buffer of triangle numbers. Larger values are nearer (1 / z for a camera, -depth for a
// parallel light), because those are linear over the image.
class DepthBuffer {
 public:
  DepthBuffer(int width, int height) : width_(width), height_(height) {
    const auto count = static_cast<std::size_t>(width) * height;
    nearness_.assign(count, -std::numeric_limits<float>::max());
    triangle_.assign(count, -1);
  }

  int width() const { return width_; }
  int height() const { return height_; }
  std::int32_t triangle(int x, int y) const { return triangle_[Index(x, y)]; }
  float nearness(int x, int y) const { return nearness_[Index(x, y)]; }

  // Corners are sample positions (sample centres at integers) with their nearness. Spans run from
  // ceil to ceil, so triangles that share an edge neither overlap nor leave a gap. `keep(x, y)` is
  // called for each sample that passes the depth test and may reject it.
  template <typename Keep>
  void Draw(const std::array<Eigen::Array2f, 3>& corner, const std::array<float, 3>& near,
            std::int32_t id, Keep&& keep) {
    const float area = SignedArea(corner);
    if (!(std::abs(area) > 1e-12F)) return;
    const auto [slope_x, slope_y] = Slopes(corner, near[1] - near[0], near[2] - near[0], area);
    std::array<Eigen::Array2f, 3> sorted = corner;  // from top to bottom
    const auto lower = [](const auto& a, const auto& b) { return a.y() < b.y(); };
    if (lower(sorted[1], sorted[0])) std::swap(sorted[0], sorted[1]);
    if (lower(sorted[2], sorted[1])) std::swap(sorted[1], sorted[2]);
    if (lower(sorted[1], sorted[0])) std::swap(sorted[0], sorted[1]);
    const auto& [top, middle, bottom] = sorted;
    const auto limit = [](float value, int high) {
      return static_cast<int>(std::ceil(std::clamp(value, 0.0F, static_cast<float>(high))));
    };
    const int y_end = limit(bottom.y(), height_);
    const auto at = [](const Eigen::Array2f& a, const Eigen::Array2f& b, float y) {
      return a.x() + (b.x() - a.x()) * ((y - a.y()) / (b.y() - a.y()));
    };
    for (int y = limit(top.y(), height_); y < y_end; ++y) {
      const auto fy = static_cast<float>(y);
      const float long_side = at(top, bottom, fy);
      const float short_side = fy < middle.y() ? at(top, middle, fy) : at(middle, bottom, fy);
      const auto [left, right] = std::minmax(long_side, short_side);
      const int x_end = limit(right, width_);
      const int x_begin = limit(left, width_);
      float* row_near = nearness_.data() + Index(0, y);
      std::int32_t* row_id = triangle_.data() + Index(0, y);
      const float base = near[0] + slope_y * (fy - corner[0].y()) - slope_x * corner[0].x();
      for (int x = x_begin; x < x_end; ++x) {
        const float value = base + slope_x * x;
        if (value <= row_near[x] || !keep(x, y)) continue;
        row_near[x] = value;
        row_id[x] = id;
      }
    }
  }
  void Draw(const std::array<Eigen::Array2f, 3>& corner, const std::array<float, 3>& near,
            std::int32_t id) {
    Draw(corner, near, id, [](int, int) { return true; });
  }

 private:
  std::size_t Index(int x, int y) const { return static_cast<std::size_t>(y) * width_ + x; }

  int width_, height_;
  std::vector<float> nearness_;
  std::vector<std::int32_t> triangle_;
};

// A depth map seen from a distant light.
class ShadowMap {
 public:
  ShadowMap(const Light& light, const std::vector<Surface>& surfaces);
  // The fraction of the light that reaches the point, 0..1.
  float Visible(const Eigen::Vector3f& point) const;

 private:
  Eigen::Array2f ToMap(const Eigen::Vector3f& point) const;

  Eigen::Matrix3f axes_;  // rows: right, down, along the light
  Eigen::Vector3f centre_;
  float scale_ = 1.0F;   // samples per unit
  float spread_ = 1.0F;  // samples
  DepthBuffer depth_;
};

ShadowMap::ShadowMap(const Light& light, const std::vector<Surface>& surfaces)
    : centre_(CentreOfCasters(surfaces)), depth_(kShadowMapSize, kShadowMapSize) {
  const Vector3f along = -light.position.normalized();
  const Vector3f helper = std::abs(along.x()) < 0.8F ? Vector3f::UnitX() : Vector3f::UnitY();
  axes_.row(2) = along;
  axes_.row(0) = helper.cross(along).normalized();
  axes_.row(1) = along.cross(axes_.row(0).transpose());
  scale_ = 0.5F * kShadowMapSize / kShadowRadius;
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
      depth_.Draw({corner[i], corner[j], corner[k]}, {near[i], near[j], near[k]}, 0);
    }
  }
}

Eigen::Array2f ShadowMap::ToMap(const Vector3f& point) const {
  const Vector3f local = axes_ * (point - centre_);
  return local.head<2>().array() * scale_ + 0.5F * kShadowMapSize;
}

float ShadowMap::Visible(const Vector3f& point) const {
  const Eigen::Array2f at = ToMap(point);
  const float near = -axes_.row(2).dot(point - centre_) + 0.012F + 0.5F * spread_ / scale_;
  int lit = 0;
  constexpr int kTaps = 4;
  for (int j = 0; j < kTaps; ++j) {
    for (int i = 0; i < kTaps; ++i) {
      const float dx = (2.0F * i / (kTaps - 1) - 1.0F) * spread_;
      const float dy = (2.0F * j / (kTaps - 1) - 1.0F) * spread_;
      const int x = static_cast<int>(std::floor(at.x() + dx + 0.5F));
      const int y = static_cast<int>(std::floor(at.y() + dy + 0.5F));
      if (x < 0 || y < 0 || x >= depth_.width() || y >= depth_.height() ||
          depth_.nearness(x, y) <= near)
        ++lit;
    }
  }
  return static_cast<float>(lit) / (kTaps * kTaps);
}

// One map for each light that casts shadows, in order.
std::vector<ShadowMap> MakeShadowMaps(const Lighting& lighting,
                                      const std::vector<Surface>& surfaces) {
  std::vector<ShadowMap> maps;
  for (const Light& light : lighting.lights) {
    if (light.casts_shadow) maps.emplace_back(light, surfaces);
  }
  return maps;
}

// Per vertex: light on the front and on the back (to multiply the surface's colour) and highlight.
struct VertexLight {
  std::vector<Colour> front, back, gloss;
};

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

constexpr int kSamples = 2;          // per pixel and axis
constexpr float kNearPlane = 0.05F;  // camera units
constexpr float kMagnified = -0.9F;  // level of detail from which a pixel covers hardly a texel

// Values that are linear over the image after division by depth: value(x, y) = dx x + dy y +
// base. What is linear on a plane in space is, divided by z, linear in its image, and so is 1/z;
// their quotient is the value itself (perspective-correct interpolation; Blinn 1992).
struct Plane {
  Colour dx, dy, base;

  Colour At(float x, float y) const { return dx * x + dy * y + base; }
};

// A triangle on the image: 1/z, u/z, v/z and light/z (light: R, G, B of the side that is seen).
struct Drawn {
  Plane place;  // 1/z, u/z, v/z, 0
  Plane light;  // red/z, green/z, blue/z, 0
  Plane gloss;
  float lod = 0.0F;
  float weave = 0.0F;  // contrast of the threads at this size
  const Surface* surface = nullptr;
  Array2f low_uv, high_uv;  // of the corners, and half as much again around them
  bool front = true;
  bool smooth = false;  // changes so little within a pixel that one sample will do
};

struct Corner {
  Array2f at;  // sample coordinates
  float inverse_z = 0.0F;
};

Plane MakePlane(const std::array<Array2f, 3>& at, const std::array<Colour, 3>& value, float area) {
  const auto [dx, dy] = Slopes<Colour>(at, value[1] - value[0], value[2] - value[0], area);
  return {dx, dy, value[0] - dx * at[0].x() - dy * at[0].y()};
}

// Mip level for one sample: the longer axis of a sample's footprint on the texture.
float LevelOfDetail(const Surface& surface, const std::array<int, 3>& triangle,
                    const std::array<Array2f, 3>& at, float area) {
  if (surface.material.texture == nullptr) return 0.0F;
  const Array2f size(static_cast<float>(surface.material.texture->width()),
                     static_cast<float>(surface.material.texture->height()));
  const Array2f t0 = surface.uv[triangle[0]];
  const Array2f d1 = (surface.uv[triangle[1]] - t0) * size;
  const Array2f d2 = (surface.uv[triangle[2]] - t0) * size;
  const auto [dx, dy] = Slopes(at, d1, d2, area);
  // Largest singular value of the 2 x 2 Jacobian [dx dy].
  const float a = dx.square().sum();
  const float c = dy.square().sum();
  const float b = (dx * dy).sum();
  const float largest = 0.5F * (a + c + std::sqrt((a - c) * (a - c) + 4.0F * b * b));
  return 0.5F * std::log2(std::max(1e-6F, largest));
}

// A triangle in sample coordinates.
struct Projected {
  std::array<Array2f, 3> at;
  std::array<float, 3> near{};
  float area = 0.0F;  // positive: its front is seen

  bool IsSeen(const DepthBuffer& buffer, bool closed) const {
    if (std::ranges::min(near) <= 0.0F || std::abs(area) < 1e-9F || (closed && area < 0.0F))
      return false;
    const Array2f low = at[0].min(at[1]).min(at[2]);
    const Array2f high = at[0].max(at[1]).max(at[2]);
    return high.x() >= 0.0F && high.y() >= 0.0F && low.x() <= static_cast<float>(buffer.width()) &&
           low.y() <= static_cast<float>(buffer.height());
  }
};

Drawn MakeDrawn(const Surface& surface, const VertexLight& light,
                const std::array<int, 3>& triangle, const Projected& projected) {
  const Material& material = surface.material;
  Drawn drawn;
  drawn.surface = &surface;
  drawn.front = projected.area > 0.0F;
  drawn.lod = LevelOfDetail(surface, triangle, projected.at, projected.area);
  if (material.weave > 0.0F && material.texture != nullptr) {
    // Threads that are smaller than two samples would only make moire.
    const float threads = std::exp2(drawn.lod) * material.threads / material.texture->width();
    drawn.weave = material.weave * std::clamp(1.5F - 3.0F * threads, 0.0F, 1.0F);
  }
  drawn.smooth = drawn.weave == 0.0F && material.relief == nullptr &&
                 (material.texture == nullptr || drawn.lod < kMagnified);
  std::array<Colour, 3> place, lit, gloss;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(triangle[k]);
    const Array2f& uv = surface.uv[i];
    drawn.low_uv = k == 0 ? uv : drawn.low_uv.min(uv).eval();
    drawn.high_uv = k == 0 ? uv : drawn.high_uv.max(uv).eval();
    place[k] = Colour(1.0F, uv.x(), uv.y(), 0.0F) * projected.near[k];
    lit[k] = (drawn.front ? light.front[i] : light.back[i]) * projected.near[k];
    gloss[k] = light.gloss[i] * projected.near[k];
  }
  const Array2f margin = 0.5F * (drawn.high_uv - drawn.low_uv);
  drawn.low_uv = (drawn.low_uv - margin).max(0.0F);
  drawn.high_uv = (drawn.high_uv + margin).min(1.0F);
  drawn.place = MakePlane(projected.at, place, projected.area);
  drawn.light = MakePlane(projected.at, lit, projected.area);
  if (material.gloss > 0.0F) drawn.gloss = MakePlane(projected.at, gloss, projected.area);
  return drawn;
}

class Drawing {
 public:
  explicit Drawing(const Camera& camera)
      : camera_(camera), depth_(camera.width * kSamples, camera.height * kSamples) {}

  void Add(const Surface& surface, const VertexLight& light);
  Frame Resolve(const std::vector<Colour>& backdrop) const;

 private:
  static float SampleOfCentre(int pixel) { return (pixel + 0.5F) * kSamples - 0.5F; }
  // The triangle that all samples of a pixel show, or -1.
  std::int32_t OnlyTriangle(int x, int y) const;
  Colour Shade(const Drawn& drawn, float x, float y) const;
  void ResolvePixel(int x, int y, const Colour& behind, Frame& frame) const;
  void WriteTruth(const Drawn& drawn, int x, int y, Frame& frame) const;

  const Camera& camera_;
  DepthBuffer depth_;
  std::vector<Drawn> drawn_;
};

void Drawing::Add(const Surface& surface, const VertexLight& light) {
  std::vector<Corner> corners(surface.positions.size());
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector3f p = camera_.ToCamera(surface.positions[i]);
    if (!(p.z() > kNearPlane)) continue;
    // Pixel centres are at integers; sample s of a pixel is at (s + 0.5) / kSamples - 0.5.
    corners[i] = {(camera_.Project(p) + 0.5F) * kSamples - 0.5F, 1.0F / p.z()};
  }
  const bool cut = surface.outline != nullptr && !surface.outline->empty();
  for (const auto& triangle : surface.triangles) {
    Projected projected;
    for (std::size_t k = 0; k < 3; ++k) {
      const Corner& corner = corners[triangle[k]];
      projected.at[k] = corner.at;
      projected.near[k] = corner.inverse_z;
    }
    projected.area = SignedArea(projected.at);
    if (!projected.IsSeen(depth_, surface.closed)) continue;
    const auto id = static_cast<std::int32_t>(drawn_.size());
    const Drawn& drawn = drawn_.emplace_back(MakeDrawn(surface, light, triangle, projected));
    if (!cut) {
      depth_.Draw(projected.at, projected.near, id);
      continue;
    }
    depth_.Draw(projected.at, projected.near, id, [&](int x, int y) {
      const Colour p = drawn.place.At(static_cast<float>(x), static_cast<float>(y));
      return surface.outline->Contains(p[1] / p[0], p[2] / p[0]);
    });
  }
}

// A plain weave: the brightness of threads that cross over and under one another.
float Weave(float u, float v, float contrast) {
  const float x = u - std::floor(u);
  const float y = v - std::floor(v);
  const bool over = (static_cast<int>(std::floor(u)) + static_cast<int>(std::floor(v))) % 2 == 0;
  const float across = over ? x : y;
  return 1.0F + contrast * (4.0F * across * (1.0F - across) - 0.667F);
}

Colour Drawing::Shade(const Drawn& drawn, float x, float y) const {
  const Material& material = drawn.surface->material;
  const Colour place = drawn.place.At(x, y);
  const float z = 1.0F / place[0];
  const float u = place[1] * z;
  const float v = place[2] * z;
  Colour albedo = material.tint;
  if (material.texture != nullptr) {
    const Colour texel = material.texture->Sample(u, v, drawn.lod);
    albedo *= drawn.front ? texel
                          : Colour(material.back + material.show_through * (texel - material.back));
    if (drawn.weave > 0.0F) {
      const float aspect = material.texture->aspect();
      albedo *= Weave(u * material.threads, v * material.threads * aspect, drawn.weave);
    }
  } else if (!drawn.front) {
    albedo = material.back;
  }
  if (material.relief != nullptr) {
    const float tilt = (material.relief->Slope(u, v) * material.relief_light).sum();
    albedo *= std::clamp(1.0F + tilt, 0.3F, 1.8F);
  }
  Colour colour = albedo * (drawn.light.At(x, y) * z).max(0.0F);
  if (material.gloss > 0.0F && drawn.front) colour += (drawn.gloss.At(x, y) * z).max(0.0F);
  return colour;
}

std::int32_t Drawing::OnlyTriangle(int x, int y) const {
  const std::int32_t id = depth_.triangle(x * kSamples, y * kSamples);
  for (int sample = 1; sample < kSamples * kSamples; ++sample) {
    if (depth_.triangle(x * kSamples + sample % kSamples, y * kSamples + sample / kSamples) != id)
      return -1;
  }
  return id;
}

// What the pixel's centre sees; the centre may lie just outside a narrow triangle.
void Drawing::WriteTruth(const Drawn& drawn, int x, int y, Frame& frame) const {
  const std::size_t at = frame.At(x, y);
  const Colour place = drawn.place.At(SampleOfCentre(x), SampleOfCentre(y));
  frame.chart[at] = static_cast<std::uint8_t>(drawn.surface->chart);
  for (int k = 0; k < 2; ++k) {
    const float value = std::clamp(place[k + 1] / place[0], drawn.low_uv[k], drawn.high_uv[k]);
    frame.uv[2 * at + static_cast<std::size_t>(k)] =
        static_cast<std::uint16_t>(std::lround(value * 65535.0F));
  }
}

void Drawing::ResolvePixel(int x, int y, const Colour& behind, Frame& frame) const {
  const std::size_t at = frame.At(x, y);
  const std::int32_t only = OnlyTriangle(x, y);
  if (only >= 0 && drawn_[only].smooth) {
    const Drawn& drawn = drawn_[only];
    frame.colour[at] = Shade(drawn, SampleOfCentre(x), SampleOfCentre(y));
    if (drawn.front && drawn.surface->chart >= 0) WriteTruth(drawn, x, y, frame);
    return;
  }
  Colour sum = Colour::Zero();
  const Drawn* nearest = nullptr;
  float nearness = 0.0F;
  int on_object = 0;
  for (int sample = 0; sample < kSamples * kSamples; ++sample) {
    const int sx = x * kSamples + sample % kSamples;
    const int sy = y * kSamples + sample / kSamples;
    const std::int32_t id = depth_.triangle(sx, sy);
    if (id < 0) {
      sum += behind;
      continue;
    }
    const Drawn& drawn = drawn_[id];
    sum += Shade(drawn, static_cast<float>(sx), static_cast<float>(sy));
    if (!drawn.front || drawn.surface->chart < 0) continue;
    ++on_object;
    if (depth_.nearness(sx, sy) > nearness) {
      nearest = &drawn;
      nearness = depth_.nearness(sx, sy);
    }
  }
  frame.colour[at] = sum / static_cast<float>(kSamples * kSamples);
  // More than half of the samples, so that the border of the object is never claimed.
  if (on_object * 2 > kSamples * kSamples) WriteTruth(*nearest, x, y, frame);
}

Frame Drawing::Resolve(const std::vector<Colour>& backdrop) const {
  Frame frame;
  frame.width = camera_.width;
  frame.height = camera_.height;
  const auto count = static_cast<std::size_t>(frame.width) * frame.height;
  frame.colour.resize(count);
  frame.chart.assign(count, kNoChart);
  frame.uv.assign(2 * count, 0);
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      const Colour behind = backdrop.empty() ? Colour(Colour::Zero()) : backdrop[frame.At(x, y)];
      ResolvePixel(x, y, behind, frame);
    }
  }
  return frame;
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

double Coverage(const std::vector<std::uint8_t>& chart) {
  const auto on = std::ranges::count_if(chart, [](std::uint8_t c) { return c != kNoChart; });
  return static_cast<double>(on) / static_cast<double>(std::max<std::size_t>(1, chart.size()));
}

Frame Render(const std::vector<Surface>& surfaces, const Lighting& lighting, const Camera& camera,
             const std::vector<Colour>& backdrop) {
  const std::vector<ShadowMap> shadows = MakeShadowMaps(lighting, surfaces);
  const Vector3f eye = camera.Position();
  Drawing drawing(camera);
  for (const Surface& surface : surfaces) {
    drawing.Add(surface, LightVertices(surface, lighting, shadows, eye));
  }
  return drawing.Resolve(backdrop);
}

}  // namespace pliant::simulation
