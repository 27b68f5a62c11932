// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "descriptor/simulation/backdrop.h"
#include "descriptor/simulation/framing.h"
#include "descriptor/simulation/surface.h"

namespace pliant::simulation {
namespace {

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
    if (!shot.evenly_lit) view.photo.exposure *= MeterPicture(frame);
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
