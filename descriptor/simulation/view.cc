// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "descriptor/simulation/photo.h"
#include "descriptor/simulation/surface.h"

namespace pliant::simulation {
namespace {

constexpr std::size_t kOthers = 5;  // images besides the object's that a scene uses

// Which texture scene `index` shows: all of them in turn, but neighbours in the source (often of
// one kind) far apart, so that the first scenes of a set are as mixed as the whole.
std::size_t TextureOfScene(std::size_t count, std::uint64_t seed, std::uint64_t index) {
  auto step = static_cast<std::size_t>(0.618 * static_cast<double>(count)) + 1;
  while (std::gcd(step, count) != 1) ++step;
  return static_cast<std::size_t>((seed % count + (index % count) * step) % count);
}

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

using Eigen::Matrix3f;
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

// height x width colours: a part of `texture`, rotated, perhaps out of focus; or a soft gradient
// when it is null.
std::vector<Colour> DrawBackdrop(Random& random, const Texture* texture, int width, int height) {
  std::vector<Colour> pixels;
  pixels.reserve(static_cast<std::size_t>(width) * height);
  const Colour first = DrawPlainColour(random);
  if (texture == nullptr) {
    const Colour second = (first * random.Uniform(0.5F, 1.6F)).min(1.0F);
    const float turn = random.Angle();
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const float s = std::cos(turn) * (static_cast<float>(x) / width - 0.5F) +
                        std::sin(turn) * (static_cast<float>(y) / height - 0.5F);
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
  const int middle_x = width / 2;
  const int middle_y = height / 2;
  const float lod = std::log2(std::max(1e-3F, zoom * texture->width()));
  const auto mirror = [](float t) {
    const float folded = std::fmod(std::abs(t), 2.0F);
    return folded > 1.0F ? 2.0F - folded : folded;
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto dx = static_cast<float>(x - middle_x);
      const auto dy = static_cast<float>(y - middle_y);
      const float u = mirror(centre_u + cos * dx - sin * dy);
      const float v = mirror(centre_v + (sin * dx + cos * dy) / texture->aspect());
      const Colour texel = texture->Sample(u, v, lod);
      pixels.emplace_back(gain * (texel + wash * (first - texel)));
    }
  }
  if (random.Chance(0.5F)) Blur(pixels, width, height, random.LogUniform(0.8F, 6.0F));
  return pixels;
}

constexpr float kDegree = kPi / 180.0F;

// Mean directions of a chart's u axis and of its front, over the columns around `facing_u`.
// Rows of the result: right, down, away from the viewer of the front.
Matrix3f MeanFrame(const Body& body, const Pose& pose, float facing_u) {
  const Chart& chart = body.charts[0];
  Vector3f right = Vector3f::Zero();
  Vector3f normal = Vector3f::Zero();
  float area = 0.0F;
  for (int row = 0; row + 1 < chart.rows; ++row) {
    for (int column = 0; column + 1 < chart.columns; ++column) {
      const float u = static_cast<float>(column) / (chart.columns - 1);
      if (body.kind == BodyKind::kTube && std::abs(u - facing_u) > 0.12F) continue;
      const int a = chart.At(column, row);
      const int b = chart.At(column + 1, row);
      const int c = chart.At(column, row + 1);
      if (a < 0 || b < 0 || c < 0) continue;
      const Vector3f across = pose.positions[b] - pose.positions[a];
      const Vector3f down = pose.positions[c] - pose.positions[a];
      right += across;
      normal += across.cross(down);
      area += across.norm() * down.norm();
    }
  }
  const bool on_table = std::ranges::any_of(
      pose.solids, [](const Solid& solid) { return solid.kind == SolidKind::kTable; });
  // A table is looked at from above; so is cloth that is folded so far that it has no mean side.
  if (on_table || normal.norm() < 0.2F * area) normal = Vector3f::UnitZ();
  normal.normalize();
  right -= normal * normal.dot(right);
  if (right.norm() < 1e-3F) right = normal.unitOrthogonal();
  right.normalize();
  Matrix3f frame;
  frame.row(0) = right;
  frame.row(1) = normal.cross(right);
  frame.row(2) = normal;
  return frame;
}

// A camera for the pose. `facing_u`: which part of a tube faces the camera (0.5 = its front).
Camera PlaceCamera(const Body& body, const Pose& pose, const Framing& framing, float facing_u,
                   int width, int height) {
  const float tilt_axis = framing.tilt_direction_deg * kDegree;
  const Matrix3f tilt = Eigen::AngleAxisf(framing.tilt_deg * kDegree,
                                          Vector3f(std::cos(tilt_axis), std::sin(tilt_axis), 0.0F))
                            .toRotationMatrix();
  const Matrix3f roll =
      Eigen::AngleAxisf(framing.roll_deg * kDegree, Vector3f::UnitZ()).toRotationMatrix();
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.rotation = roll * tilt * MeanFrame(body, pose, facing_u);
  const auto w = static_cast<float>(width);
  const auto h = static_cast<float>(height);
  const Chart& chart = body.charts[0];
  const float visible_width = body.kind == BodyKind::kTube ? chart.width / kPi : chart.width;
  const float fit = std::min(w / visible_width, h / chart.height);  // pixels a unit
  camera.focal_px = fit * framing.scale * framing.distance;
  // The middle of the body's extent goes to the image's centre, then the shift.
  Vector3f low = Vector3f::Constant(1e9F);
  Vector3f high = -low;
  for (const Vector3f& position : pose.positions) {
    const Vector3f p = camera.rotation * position;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const Vector3f middle = 0.5F * (low + high);
  camera.translation = -middle + Vector3f(0.0F, 0.0F, framing.distance);
  camera.centre_x = 0.5F * (w - 1.0F);
  camera.centre_y = 0.5F * (h - 1.0F);
  // A small object may go nearly to the border, a large one hang out of the image.
  const float pixels = fit * framing.scale;
  camera.centre_x +=
      framing.shift_x * (0.4F * std::abs(w - pixels * (high.x() - low.x())) + 0.03F * w);
  camera.centre_y +=
      framing.shift_y * (0.4F * std::abs(h - pixels * (high.y() - low.y())) + 0.03F * h);
  return camera;
}

// Turns and zooms so that the middle of the focus falls where it is meant to, in the size meant.
void AimCamera(const Chart& chart, const Pose& pose, const Focus& focus, Camera& camera) {
  const Eigen::Array2f middle = 0.5F * (focus.place.low + focus.place.high);
  const auto nearest = [](float t, int count) {
    return std::clamp(static_cast<int>(std::lround(t * (count - 1))), 0, count - 1);
  };
  const int particle =
      chart.At(nearest(middle.x(), chart.columns), nearest(middle.y(), chart.rows));
  if (particle < 0) return;
  const Vector3f p = camera.ToCamera(pose.positions[particle]);
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

Cast DrawCast(const TextureSource& textures, Preset preset, std::uint64_t seed, std::uint64_t index,
              Random& random) {
  const std::size_t count = textures.size();
  const std::size_t own = TextureOfScene(count, seed, index);
  Cast cast{textures.Get(own)};
  for (std::size_t i = 0; i < kOthers && count > 1; ++i) {
    if (preset != Preset::kObjects) {
      cast.push_back(textures.Get((own + random.Integer(1, static_cast<int>(count) - 1)) % count));
      continue;
    }
    const int number = random.Integer(static_cast<int>(count / 2), static_cast<int>(count) - 1);
    const std::size_t other = TextureOfScene(count, seed, static_cast<std::uint64_t>(number));
    if (other != own) cast.push_back(textures.Get(other));
  }
  return cast;
}

const Texture* AnyOther(const Cast& cast, Random& random) {
  if (cast.size() < 2) return nullptr;
  return cast[random.Integer(1, static_cast<int>(cast.size()) - 1)].get();
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

Framing DrawFraming(Random& random, float strength) {
  Framing framing;
  framing.roll_deg = random.Uniform(0.0F, 360.0F);
  framing.tilt_deg = 60.0F * strength * std::sqrt(random.Uniform());
  framing.tilt_direction_deg = random.Uniform(0.0F, 360.0F);
  // Most views fill a good part of the image; the ends are there too.
  framing.scale =
      random.Chance(0.7F) ? random.LogUniform(0.6F, 1.6F) : random.LogUniform(0.3F, 2.0F);
  framing.distance = random.LogUniform(1.6F, 4.5F);
  framing.shift_x = random.Uniform(-1.0F, 1.0F);
  framing.shift_y = random.Uniform(-1.0F, 1.0F);
  return framing;
}

Framing DrawFrontalFraming(Random& random) {
  Framing framing;
  framing.roll_deg = random.Uniform(-12.0F, 12.0F);
  framing.tilt_deg = random.Uniform(0.0F, 10.0F);
  framing.tilt_direction_deg = random.Uniform(0.0F, 360.0F);
  framing.scale = random.Uniform(0.85F, 0.98F);
  framing.distance = random.Uniform(2.5F, 5.0F);
  framing.shift_x = random.Uniform(-0.3F, 0.3F);
  framing.shift_y = random.Uniform(-0.3F, 0.3F);
  return framing;
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
  if (!shot.evenly_lit) view.photo.exposure *= MeterExposure(frame, shot.develop ? 0.0F : 0.75F);
  view.image = shot.develop ? Develop(frame, view.photo, *shot.develop, options.channels, random)
                            : TakePhoto(frame, view.photo, options.channels, random);
  view.chart = std::move(frame.chart);
  view.uv = std::move(frame.uv);
  return view;
}

}  // namespace pliant::simulation
