// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "descriptor/simulation/photo.h"
#include "descriptor/simulation/street.h"
#include "descriptor/simulation/surface.h"

namespace pliant::simulation {
namespace {

constexpr std::size_t kOthers = 5;  // images besides the object's that a scene uses

Colour DrawPlainColour(Random& random) {
  const float grey = random.LogUniform(0.03F, 0.8F);
  return Colour(grey * random.Uniform(0.75F, 1.25F), grey, grey * random.Uniform(0.7F, 1.3F), 0.0F);
}

// A capsule (segment with a radius), in pixels; covers strips, discs and fingers.
struct Capsule {
  Eigen::Array2f from, to;
  float radius;

  // Distance to the surface, negative inside; `across` is the offset from the axis.
  float Distance(const Eigen::Array2f& p, Eigen::Array2f& across) const {
    const Eigen::Array2f axis = to - from;
    const float length = axis.square().sum();
    const float t =
        length > 0.0F ? std::clamp(((p - from) * axis).sum() / length, 0.0F, 1.0F) : 0.0F;
    across = p - (from + t * axis);
    return std::sqrt(across.square().sum()) - radius;
  }
};

Capsule DrawCapsule(Random& random, int width, int height) {
  const auto w = static_cast<float>(width);
  const auto h = static_cast<float>(height);
  Capsule capsule;
  const float turn = random.Angle();
  const Eigen::Array2f along(std::cos(turn), std::sin(turn));
  capsule.from = Eigen::Array2f(w * random.Uniform(0.15F, 0.85F), h * random.Uniform(0.15F, 0.85F));
  const float kind = random.Uniform();
  if (kind < 0.4F) {  // something long that comes in from outside: a finger, an arm, a pole
    capsule.radius = h * random.Uniform(0.02F, 0.07F);
    capsule.to = capsule.from + along * 2.0F * w;
  } else if (kind < 0.7F) {  // a coin, a lid, a stone
    capsule.radius = h * random.Uniform(0.03F, 0.12F);
    capsule.to = capsule.from;
  } else {  // a pen, a strip
    capsule.radius = h * random.Uniform(0.008F, 0.03F);
    capsule.to = capsule.from + along * h * random.Uniform(0.2F, 0.7F);
  }
  return capsule;
}

using Eigen::Vector3f;

std::vector<Surface> MakeSurfaces(const Stage& stage, const Pose& pose, bool alone, Random& random,
                                  std::vector<RefinedChart>& grids) {
  std::vector<Surface> surfaces;
  for (std::size_t c = 0; c < stage.body.charts.size(); ++c) {
    const Chart& chart = stage.body.charts[c];
    grids.push_back(Refine(chart, pose.positions, stage.options.refine));
    const float cell = chart.width / static_cast<float>(grids.back().columns - 1);
    Surface surface = MakeChartSurface(grids.back(), cell);
    surface.chart = static_cast<int>(c);
    surface.material = stage.materials[c];
    surface.outline = &chart.outline;
    surface.closed = stage.body.kind == BodyKind::kPillow;
    surfaces.push_back(std::move(surface));
  }
  std::vector<Solid> solids = pose.solids;
  const bool table =
      std::ranges::any_of(solids, [](const Solid& s) { return s.kind == SolidKind::kTable; });
  if (!table && random.Chance(0.35F)) {
    // A wall close behind, for the shadow.
    float deepest = -1e9F;
    for (const Vector3f& position : pose.positions) deepest = std::max(deepest, position.z());
    Solid wall;
    wall.kind = SolidKind::kTable;
    wall.centre.z() = deepest + random.LogUniform(0.01F, 0.5F);
    solids.push_back(wall);
  }
  for (const Solid& solid : solids) {
    Surface surface = MakeSolidSurface(solid);
    const Texture* other = random.Chance(0.6F) ? AnyOther(stage.cast, random) : nullptr;
    if (alone) other = nullptr;
    surface.material = DrawMaterial(other, random);
    surface.material.weave = 0.0F;
    surface.material.tint = other != nullptr
                                ? Colour(Colour::Constant(random.LogUniform(0.4F, 1.0F)))
                                : surface.material.back;
    surfaces.push_back(std::move(surface));
  }
  return surfaces;
}

std::vector<Eigen::Array2f> ProjectGrids(const std::vector<RefinedChart>& grids,
                                         const Camera& camera) {
  std::vector<Eigen::Array2f> projected;
  for (const RefinedChart& grid : grids) {
    for (const Vector3f& position : grid.positions) {
      const Vector3f p = camera.ToCamera(position);
      const bool known = p.allFinite() && p.z() > 1e-3F;
      projected.emplace_back(known ? camera.Project(p)
                                   : Eigen::Array2f(Eigen::Array2f::Constant(
                                         std::numeric_limits<float>::quiet_NaN())));
    }
  }
  return projected;
}

// Turns and zooms so that the middle of the focus falls where it is meant to, in the size meant.
void AimCamera(const Chart& chart, const Pose& pose, const Focus& focus, Camera& camera) {
  const Eigen::Array2f middle = 0.5F * (focus.place.low + focus.place.high);
  const auto nearest = [](float t, int count) {
    return std::clamp(static_cast<int>(std::lround(t * static_cast<float>(count - 1))), 0,
                      count - 1);
  };
  const int particle =
      chart.At(nearest(middle.x(), chart.columns), nearest(middle.y(), chart.rows));
  if (particle < 0) return;
  const Vector3f p = camera.ToCamera(pose.positions[static_cast<std::size_t>(particle)]);
  if (p.z() < 0.1F) return;
  const float width = (focus.place.high.x() - focus.place.low.x()) * chart.width;
  camera.focal_px = focus.width_px * p.z() / width;
  camera.centre_x = focus.at.x() - camera.focal_px * p.x() / p.z();
  camera.centre_y = focus.at.y() - camera.focal_px * p.y() / p.z();
}

Lighting EvenLighting(const Vector3f& view) {
  Lighting lighting;
  lighting.ambient = Colour::Ones();
  lighting.sky = view;
  return lighting;
}

}  // namespace

std::size_t TextureOfScene(std::size_t count, std::uint64_t seed, std::uint64_t index) {
  auto step = static_cast<std::size_t>(0.618 * static_cast<double>(count)) + 1;
  while (std::gcd(step, count) != 1) ++step;
  return static_cast<std::size_t>((seed % count + (index % count) * step) % count);
}

Cast DrawCast(const TextureSource& textures, std::size_t own, Random& random) {
  Cast cast{textures.Get(own)};
  for (std::size_t i = 0; i < kOthers && textures.size() > 1; ++i) {
    const int step = random.Integer(1, static_cast<int>(textures.size()) - 1);
    cast.push_back(textures.Get((own + static_cast<std::size_t>(step)) % textures.size()));
  }
  return cast;
}

Cast DrawObjectCast(const TextureSource& textures, std::size_t own, std::uint64_t seed,
                    Random& random) {
  Cast cast{textures.Get(own)};
  const std::size_t count = textures.size();
  for (std::size_t i = 0; i < kOthers && count > 1; ++i) {
    const int number = random.Integer(static_cast<int>(count / 2), static_cast<int>(count) - 1);
    const std::size_t other = TextureOfScene(count, seed, static_cast<std::uint64_t>(number));
    if (other != own) cast.push_back(textures.Get(other));
  }
  return cast;
}

const Texture* AnyOther(const Cast& cast, Random& random) {
  if (cast.size() < 2) return nullptr;
  return cast[static_cast<std::size_t>(random.Integer(1, static_cast<int>(cast.size()) - 1))].get();
}

std::vector<Colour> DrawBackdrop(Random& random, const Texture* texture, int width, int height) {
  std::vector<Colour> pixels;
  pixels.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const Colour first = DrawPlainColour(random);
  if (texture == nullptr) {
    const Colour second = (first * random.Uniform(0.5F, 1.6F)).min(1.0F);
    const float turn = random.Angle();
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const float s =
            std::cos(turn) * (static_cast<float>(x) / static_cast<float>(width) - 0.5F) +
            std::sin(turn) * (static_cast<float>(y) / static_cast<float>(height) - 0.5F);
        pixels.emplace_back(first + (second - first) * std::clamp(0.5F + s, 0.0F, 1.0F));
      }
    }
    return pixels;
  }
  // Mirrored beyond its borders, so that any turn and zoom fills the image.
  const float zoom = random.Uniform(0.35F, 0.8F) / static_cast<float>(std::max(width, height));
  const float turn = random.Chance(0.5F) ? random.Angle() : 0.05F * random.Normal();
  const float cos = zoom * std::cos(turn);
  const float sin = zoom * std::sin(turn);
  const float centre_u = random.Uniform(0.3F, 0.7F);
  const float centre_v = random.Uniform(0.3F, 0.7F);
  const float gain = random.LogUniform(0.4F, 1.3F);
  const float wash = random.Chance(0.5F) ? 0.0F : random.Uniform(0.0F, 0.7F);
  const float lod = std::log2(std::max(1e-3F, zoom * static_cast<float>(texture->width())));
  const auto mirror = [](float t) {
    const float folded = std::fmod(std::abs(t), 2.0F);
    return folded > 1.0F ? 2.0F - folded : folded;
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float dx = static_cast<float>(x - width / 2);
      const float dy = static_cast<float>(y - height / 2);
      const float u = mirror(centre_u + cos * dx - sin * dy);
      const float v = mirror(centre_v + (sin * dx + cos * dy) / texture->aspect());
      const Colour texel = texture->Sample(u, v, lod);
      pixels.emplace_back(gain * (texel + wash * (first - texel)));
    }
  }
  if (random.Chance(0.5F)) Blur(pixels, width, height, random.LogUniform(0.8F, 6.0F));
  return pixels;
}

void DrawOccluders(Random& random, const Texture* texture, Frame& frame) {
  const int count = random.Integer(1, 3);
  for (int i = 0; i < count; ++i) {
    const Capsule capsule = DrawCapsule(random, frame.width, frame.height);
    const Colour plain =
        random.Chance(0.4F) ? Colour(Colour(0.55F, 0.33F, 0.24F, 0.0F) * random.Uniform(0.3F, 1.3F))
                            : DrawPlainColour(random);
    const bool imaged = texture != nullptr && random.Chance(0.35F);
    const Eigen::Array2f light(random.Uniform(-0.7F, 0.7F), random.Uniform(-0.7F, 0.7F));
    const Eigen::Array2f shadow = -light * capsule.radius * 0.5F;
    const float shade = random.Uniform(0.35F, 0.8F);
    for (int y = 0; y < frame.height; ++y) {
      for (int x = 0; x < frame.width; ++x) {
        const Eigen::Array2f p(static_cast<float>(x), static_cast<float>(y));
        Eigen::Array2f across;
        const std::size_t at = frame.At(x, y);
        const float behind = capsule.Distance(p - shadow, across);
        const float soft = std::max(2.0F, 0.35F * capsule.radius);
        if (behind < soft)
          frame.colour[at] *=
              1.0F - (1.0F - shade) * std::clamp(0.5F - 0.5F * behind / soft, 0.0F, 1.0F);
        const float distance = capsule.Distance(p, across);
        const float cover = std::clamp(0.5F - distance, 0.0F, 1.0F);
        if (cover <= 0.0F) continue;
        // Lit like a round thing.
        const Eigen::Array2f slope = across / capsule.radius;
        const float height = std::sqrt(std::max(0.0F, 1.0F - slope.square().sum()));
        const float lit = 0.35F + 0.75F * std::max(0.0F, (slope * light).sum() + 0.75F * height);
        Colour colour = plain;
        if (imaged)
          colour = texture->Sample(p.x() / static_cast<float>(frame.width),
                                   p.y() / static_cast<float>(frame.height), 1.0F);
        frame.colour[at] += cover * (colour * lit - frame.colour[at]);
        if (cover > 0.02F && frame.chart[at] != kNoChart) {
          frame.chart[at] = kNoChart;
          frame.uv[2 * at] = 0;
          frame.uv[2 * at + 1] = 0;
        }
      }
    }
  }
}

Material DrawMaterial(const Texture* texture, Random& random) {
  Material material;
  material.texture = texture;
  const float grey = random.LogUniform(0.05F, 0.8F);
  material.back =
      Colour(grey, grey * random.Uniform(0.8F, 1.1F), grey * random.Uniform(0.7F, 1.1F), 0.0F);
  material.show_through = random.Chance(0.4F) ? random.Uniform(0.0F, 0.5F) : 0.0F;
  if (random.Chance(0.5F)) material.gloss = random.LogUniform(0.03F, 0.6F);
  material.gloss_exponent = random.LogUniform(6.0F, 90.0F);
  if (random.Chance(0.4F)) material.weave = random.Uniform(0.04F, 0.25F);
  material.threads = random.Uniform(90.0F, 320.0F);
  return material;
}

View TakeView(const Stage& stage, Shot shot, Random random) {
  const SceneOptions& options = stage.options;
  View view;
  view.motion = shot.pose.motion;
  view.stretch_p95 = shot.pose.stretch_p95;
  std::vector<RefinedChart> grids;
  // As in a catalogue: a reference of a retrieval set shows nothing else that could be found again.
  const bool alone =
      shot.clear && (options.preset == Preset::kObjects || options.preset == Preset::kStreet);
  const std::vector<Surface> surfaces = MakeSurfaces(stage, shot.pose, alone, random, grids);
  const bool street = options.preset == Preset::kStreet;
  const Texture* behind =
      random.Chance(street ? 0.95F : 0.75F) ? AnyOther(stage.cast, random) : nullptr;
  if (alone) behind = nullptr;
  view.backdrop = behind != nullptr ? behind->name() : "";
  const std::vector<Colour> backdrop = DrawBackdrop(random, behind, options.width, options.height);
  view.camera = PlaceCamera(stage.body, shot.pose, shot.framing, shot.facing_u, options.width,
                            options.height);
  if (shot.focus) AimCamera(stage.body.charts[0], shot.pose, *shot.focus, view.camera);
  view.framing = shot.framing;
  const Vector3f eye = view.camera.Position().normalized();
  view.lighting = shot.evenly_lit ? EvenLighting(eye) : DrawLighting(random, eye);
  Frame frame = Render(surfaces, view.lighting, view.camera, backdrop);
  if (!shot.clear && random.Chance(options.occluders)) {
    DrawOccluders(random, AnyOther(stage.cast, random), frame);
  }
  view.grid = ProjectGrids(grids, view.camera);
  view.photo = DrawPhoto(random, shot.strength);
  view.develop = shot.develop;
  if (shot.develop) {
    if (!shot.evenly_lit) view.photo.exposure *= MeterImage(frame);
    view.image = Develop(frame, view.photo, *shot.develop, options.channels, random);
  } else {
    view.photo.exposure *= MeterExposure(frame);
    view.image = TakePhoto(frame, view.photo, options.channels, random);
  }
  view.chart = std::move(frame.chart);
  view.uv = std::move(frame.uv);
  return view;
}

}  // namespace pliant::simulation
