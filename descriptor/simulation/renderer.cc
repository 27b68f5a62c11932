// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "descriptor/simulation/lighting.h"

namespace pliant::simulation {
namespace {

using Eigen::Array2f;
using Eigen::Vector3f;

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

// Cramer's rule for the two slopes; `area` is twice the triangle's, with its sign.
Plane MakePlane(const std::array<Array2f, 3>& at, const std::array<Colour, 3>& value, float area) {
  const Array2f e1 = at[1] - at[0];
  const Array2f e2 = at[2] - at[0];
  const Colour d1 = value[1] - value[0];
  const Colour d2 = value[2] - value[0];
  Plane plane;
  plane.dx = (d1 * e2.y() - d2 * e1.y()) / area;
  plane.dy = (d2 * e1.x() - d1 * e2.x()) / area;
  plane.base = value[0] - plane.dx * at[0].x() - plane.dy * at[0].y();
  return plane;
}

// Mip level for one sample: the longer axis of a sample's footprint on the texture.
float LevelOfDetail(const Surface& surface, const std::array<int, 3>& triangle,
                    const std::array<Array2f, 3>& at, float area) {
  if (surface.material.texture == nullptr) return 0.0F;
  const Array2f size(static_cast<float>(surface.material.texture->width()),
                     static_cast<float>(surface.material.texture->height()));
  const Array2f t0 = surface.uv[static_cast<std::size_t>(triangle[0])];
  const Array2f d1 = (surface.uv[static_cast<std::size_t>(triangle[1])] - t0) * size;
  const Array2f d2 = (surface.uv[static_cast<std::size_t>(triangle[2])] - t0) * size;
  const Array2f e1 = at[1] - at[0];
  const Array2f e2 = at[2] - at[0];
  const Array2f dx = (d1 * e2.y() - d2 * e1.y()) / area;
  const Array2f dy = (d2 * e1.x() - d1 * e2.x()) / area;
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
    const float threads =
        std::exp2(drawn.lod) * material.threads / static_cast<float>(material.texture->width());
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
  static float SampleOfCentre(int pixel) {
    return (static_cast<float>(pixel) + 0.5F) * kSamples - 0.5F;
  }
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
      const Corner& corner = corners[static_cast<std::size_t>(triangle[k])];
      projected.at[k] = corner.at;
      projected.near[k] = corner.inverse_z;
    }
    const Array2f e1 = projected.at[1] - projected.at[0];
    const Array2f e2 = projected.at[2] - projected.at[0];
    projected.area = e1.x() * e2.y() - e2.x() * e1.y();
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
  } else if (!drawn.front) {
    albedo = material.back;
  }
  if (drawn.weave > 0.0F) {
    const float aspect = material.texture->aspect();
    albedo *= Weave(u * material.threads, v * material.threads * aspect, drawn.weave);
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
  if (only >= 0 && drawn_[static_cast<std::size_t>(only)].smooth) {
    const Drawn& drawn = drawn_[static_cast<std::size_t>(only)];
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
    const Drawn& drawn = drawn_[static_cast<std::size_t>(id)];
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
  const auto count = static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height);
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

double Frame::Coverage() const {
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
