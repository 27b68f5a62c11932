// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/backdrop.h"

#include <algorithm>
#include <cmath>

#include "descriptor/simulation/photo.h"

namespace pliant::simulation {
namespace {

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

}  // namespace

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
  // Mirrored beyond its borders, so that any turn and zoom fills the picture.
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
    const bool pictured = texture != nullptr && random.Chance(0.35F);
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
        if (pictured)
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

}  // namespace pliant::simulation
