// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Screen prints of images: flat colours by brightness, lines where brightness changes, dots.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "descriptor/simulation/artwork.h"
#include "descriptor/simulation/photo.h"
#include "descriptor/simulation/procedural.h"

namespace pliant::simulation {
namespace {

constexpr int kSide = 320;
constexpr float kPi = std::numbers::pi_v<float>;

struct Plan {
  int levels = 3;         // flat colours; 0 = none, -1 = the image's own colours
  int bare = -1;          // level that is not printed
  bool lines = true;      // where it is darker than its surroundings
  float line_px = 1.0F;   // their scale
  float halftone = 0.0F;  // pitch of the dots, pixels; 0 = none
  bool cut = true;        // to a shape
};

Plan DrawPlan(Random& random) {
  Plan plan;
  const float kind = random.Uniform();
  plan.line_px = random.LogUniform(0.8F, 2.2F);
  plan.levels = random.Integer(2, 5);
  if (kind < 0.25F) {
    plan.levels = 0;
  } else if (kind < 0.5F) {
    plan.lines = false;
  } else if (kind > 0.85F) {
    plan.levels = -1;
    plan.lines = false;
    if (random.Chance(0.5F)) plan.halftone = random.Uniform(4.0F, 9.0F);
  }
  if (plan.levels > 0)
    plan.bare = random.Chance(0.85F) ? (random.Chance(0.5F) ? 0 : plan.levels - 1) : -1;
  plan.cut = random.Chance(0.7F);
  return plan;
}

// The image's colours as sRGB-like values, brightness in the fourth place.
std::vector<Colour> SampleImage(const Texture& image, int width, int height) {
  const float lod =
      std::log2(static_cast<float>(image.width()) / static_cast<float>(width) + 1e-3F);
  std::vector<Colour> pixels;
  pixels.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Colour value = image.Sample((static_cast<float>(x) + 0.5F) / static_cast<float>(width),
                                  (static_cast<float>(y) + 0.5F) / static_cast<float>(height), lod);
      value = value.max(0.0F).sqrt();
      value[3] = 0.3F * value[0] + 0.59F * value[1] + 0.11F * value[2];
      pixels.push_back(value);
    }
  }
  return pixels;
}

// Brightness below which `share` of the pixels lie.
float Quantile(const std::vector<Colour>& pixels, float share) {
  std::vector<float> values;
  for (std::size_t i = 0; i < pixels.size(); i += 7) values.push_back(pixels[i][3]);
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<float>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

float Smoothstep(float low, float high, float value) {
  const float t = std::clamp((value - low) / (high - low), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

void AddFlatColours(const Plan& plan, const std::vector<Colour>& smooth, Random& random,
                    Artwork& artwork) {
  const Palette palette(random);
  const bool by_brightness = random.Chance(0.7F);
  std::array<float, 6> limit{};
  std::array<Ink, 6> ink{};
  for (int i = 0; i < plan.levels; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const float step = (static_cast<float>(i) + 1.0F) / static_cast<float>(plan.levels);
    limit[at] =
        Quantile(smooth, std::clamp(step + random.Uniform(-0.1F, 0.1F), 0.05F, 1.0F)) + 1e-6F;
    ink[at] = palette.Any(random);
    if (by_brightness) ink[at] = (0.4F * ink[at] + 0.75F * step - 0.1F).max(0.0F).min(1.0F);
  }
  for (std::size_t p = 0; p < smooth.size(); ++p) {
    int level = 0;
    while (level + 1 < plan.levels && smooth[p][3] >= limit[static_cast<std::size_t>(level)])
      ++level;
    if (level == plan.bare) continue;
    artwork.inks[p] << ink[static_cast<std::size_t>(level)], 1.0F;
  }
}

void AddLines(const Plan& plan, const std::vector<Colour>& image, const Ink& ink,
              Artwork& artwork) {
  std::vector<Colour> fine = image;
  std::vector<Colour> coarse = image;
  Blur(fine, artwork.width, artwork.height, plan.line_px);
  Blur(coarse, artwork.width, artwork.height, 1.6F * plan.line_px);
  for (std::size_t p = 0; p < fine.size(); ++p) {
    const float dark = coarse[p][3] - fine[p][3];
    const float cover = Smoothstep(0.008F, 0.022F, dark);
    Eigen::Array4f line;
    line << ink, 1.0F;
    artwork.inks[p] += cover * (line - artwork.inks[p]);
  }
}

void AddImage(const Plan& plan, const std::vector<Colour>& image, Random& random,
              Artwork& artwork) {
  const float turn = random.Uniform(0.2F, 1.2F);
  const float step = plan.halftone > 0.0F ? 2.0F * kPi / plan.halftone : 0.0F;
  for (int y = 0; y < artwork.height; ++y) {
    for (int x = 0; x < artwork.width; ++x) {
      const auto p = static_cast<std::size_t>(y * artwork.width + x);
      float cover = 1.0F;
      if (step > 0.0F) {
        const float a =
            std::cos(turn) * static_cast<float>(x) + std::sin(turn) * static_cast<float>(y);
        const float b =
            std::cos(turn) * static_cast<float>(y) - std::sin(turn) * static_cast<float>(x);
        const float dots = 0.5F + 0.25F * (std::cos(step * a) + std::cos(step * b));
        cover = Smoothstep(-0.1F, 0.1F, dots - image[p][3]);
      }
      artwork.inks[p] << cover * image[p].head<3>(), cover;
    }
  }
}

// A rounded shape around the middle; what lies outside is not printed.
void CutToShape(Random& random, Artwork& artwork) {
  std::array<float, 6> size{};
  std::array<float, 6> phase{};
  for (std::size_t k = 0; k < size.size(); ++k) {
    size[k] = random.Normal() * 0.12F / (1.0F + 0.4F * static_cast<float>(k));
    phase[k] = random.Angle();
  }
  const float base = random.Uniform(0.65F, 0.95F);
  for (int y = 0; y < artwork.height; ++y) {
    for (int x = 0; x < artwork.width; ++x) {
      const float dx = 2.0F * static_cast<float>(x) / static_cast<float>(artwork.width) - 1.0F;
      const float dy = 2.0F * static_cast<float>(y) / static_cast<float>(artwork.height) - 1.0F;
      const float angle = std::atan2(dy, dx);
      float reach = base;
      for (std::size_t k = 0; k < size.size(); ++k)
        reach += size[k] * std::cos(static_cast<float>(k + 2) * angle + phase[k]);
      const float inside = Smoothstep(0.0F, 0.012F, reach - std::hypot(dx, dy));
      artwork.inks[static_cast<std::size_t>(y * artwork.width + x)] *= inside;
    }
  }
}

}  // namespace

Artwork DrawStencil(Random& random, const Texture& image) {
  const Plan plan = DrawPlan(random);
  Artwork artwork;
  const float aspect = std::clamp(image.aspect(), 0.6F, 1.6F);
  artwork.width =
      static_cast<int>(std::lround(static_cast<float>(kSide) * std::min(1.0F, 1.0F / aspect)));
  artwork.height =
      static_cast<int>(std::lround(static_cast<float>(kSide) * std::min(1.0F, aspect)));
  const std::vector<Colour> pixels = SampleImage(image, artwork.width, artwork.height);
  artwork.inks.assign(pixels.size(), Eigen::Array4f::Zero());
  if (plan.levels > 0) {
    std::vector<Colour> smooth = pixels;
    Blur(smooth, artwork.width, artwork.height, random.LogUniform(1.5F, 4.0F));
    AddFlatColours(plan, smooth, random, artwork);
  }
  if (plan.levels < 0) AddImage(plan, pixels, random, artwork);
  if (plan.lines) {
    const Ink ink = plan.levels > 0 || random.Chance(0.6F)
                        ? Ink(Ink::Constant(random.Uniform(0.0F, 0.2F)))
                        : FromHue(random.Uniform(), random.Uniform(), random.Uniform(0.3F, 1.0F));
    AddLines(plan, pixels, ink, artwork);
  }
  if (plan.cut) CutToShape(random, artwork);
  return artwork;
}

}  // namespace pliant::simulation
